"""The command that evaluates a policy."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

from kine2go_warp.cli.commands import limit_threads
from kine2go_warp.cli.data import Device, OtherClips, PolicyPath, read_clips
from kine2go_warp.cli.texts import say
from kine2go_warp.errors import PolicyError
from kine2go_warp.evaluation.config import EvalConfig
from kine2go_warp.files import atomic_file, check_place
from kine2go_warp.tables import markdown

if TYPE_CHECKING:
    from kine2go_warp.evaluation.metrics import Result
    from kine2go_warp.tables import Table

HEADLINES = (
    *("joint_rmse", "root_error", "root_angle", "foot_error"),
    *("action_rate", "torque_saturation", "power", "cost_of_transport"),
)
"""Metrics that are shown."""


@dataclass(frozen=True)
class Eval:
    """Evaluate a policy over all phases: with and without noise on its actions, randomisation and pushes.

    Example: kine2go policy eval runs/policies/dog_trot --worlds 64
    """

    policy: PolicyPath
    """Policy folder made by 'kine2go policy train'."""
    clips: OtherClips = ()
    json: Path | None = None
    """Write the results to this file, and the pictures beside it; by default eval.json in the policy folder."""
    markdown: Path | None = None
    """Write the table to this file, too."""
    overwrite: bool = False
    """Replace the file if it is there; the one in the policy folder always is."""
    device: Device = None
    config: tyro.conf.OmitArgPrefixes[EvalConfig] = field(default_factory=EvalConfig)

    def run(self) -> int:
        """Evaluate with a progress bar, write and draw, and print a table."""
        from kine2go_warp.learning.policy import PolicyFolder

        check_output(self.json, self.overwrite)
        policy = PolicyFolder(self.policy)
        policy.read_record()
        policy.latest_checkpoint()
        path = self.json or policy.path / "eval.json"
        for one in (path, self.markdown or path):
            check_place(one)
        clips = read_clips(self.clips)

        from kine2go_warp.cli.progress import Progress
        from kine2go_warp.device import choose_device
        from kine2go_warp.evaluation.evaluate import evaluate
        from kine2go_warp.evaluation.plots import draw_phases
        from kine2go_warp.evaluation.report import write_evaluation

        limit_threads()
        device = choose_device(self.device)
        with Progress() as progress:
            progress.stage(policy.path.resolve().name, "eval")
            results = evaluate(policy, self.config, device, progress.advanced, clips)
        write_evaluation(policy, self.config, results, device, path)
        pictures = [
            draw_phases(clip, results, path.with_name(f"{path.stem}_{clip}.png"))
            for clip in dict.fromkeys(one.clip for one in results)
        ]
        print_results(policy.path, self.config, results, self.markdown)
        say(f"{path}: all metrics with intervals and of every rollout; errors over the cycle: {shown(pictures)}")
        return 0


def check_output(path: Path | None, overwrite: bool) -> None:
    """Check that a file may be written that somebody has named.

    Raises:
        PolicyError: it may not.
    """
    if path is not None and path.is_dir():
        raise PolicyError(f"{path}: is a folder; name a file for the results")
    if path is not None and path.exists() and not overwrite:
        raise PolicyError(f"{path}: exists; choose another name, or replace it with --overwrite")


def shown(pictures: Sequence[Path]) -> str:
    """Return the names of a few pictures."""
    return ", ".join(map(str, pictures[:3])) + (f" and {len(pictures) - 3} more" if len(pictures) > 3 else "")


def print_results(policy: Path, config: EvalConfig, results: "Sequence[Result]", file: Path | None) -> None:
    """Print a line for each clip and condition, and write them as Markdown to a file, if one is named."""
    from kine2go_warp.cli.tables import print_table
    from kine2go_warp.evaluation.metrics import MIN_SURVIVAL, THRESHOLDS

    title = f"{policy}: {config.worlds} rollouts of {config.seconds:g} s a line, {config.randomization} randomisation"
    met = ["yes" if one.meets_thresholds else "no" for one in results]
    table = results_table(title, "condition", results, {"meets thresholds": met})
    print_table(table)
    if file is not None:
        with atomic_file(file) as temporary:
            temporary.write_text(markdown(table))
    thresholds = ", ".join(f"{name} <= {value:g}" for name, value in THRESHOLDS.items())
    say(f"thresholds: {thresholds}, survival >= {MIN_SURVIVAL:g}")
    print_early_ends(results)


def results_table(
    title: str, condition: str, results: "Sequence[Result]", more: Mapping[str, Sequence[str]] | None = None
) -> "Table":
    """Return a table with a row for each result.

    Args:
        title: Title of the table.
        condition: What the results of a clip differ by, a heading.
        results: The results.
        more: Further columns, a text for each result, by their headings.
    """
    from kine2go_warp.evaluation.metrics import METRICS_BY_NAME
    from kine2go_warp.tables import Cell, make_table, number_text

    more = more or {}
    rows = []
    for index, one in enumerate(results):
        share = f"{number_text(one.survival.value)} ({one.survival.low:.2f}-{one.survival.high:.2f})"
        numbers = (number_text(one.estimate(name).value) for name in HEADLINES)
        rows.append(
            (Cell(one.clip, code=True), one.condition, share, *numbers, *(texts[index] for texts in more.values()))
        )
    columns = (f"{METRICS_BY_NAME[name].heading} [{METRICS_BY_NAME[name].unit}]" for name in HEADLINES)
    headings = ("clip", condition, "survival [1] (95 %)", *columns, *more)
    return make_table(title, headings, rows, ("clip", condition))


def print_early_ends(results: "Sequence[Result]") -> None:
    """Print why rollouts ended before their time."""
    for one in results:
        if one.reasons:
            early = ", ".join(f"{count} by {reason}" for reason, count in one.reasons.items())
            say(f"ended early: {one.clip}, {one.condition}: {early}")
