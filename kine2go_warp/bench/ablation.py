"""Trainings that differ in one choice each, over several clips and seeds; results as JSON lines, one a training."""

import json
import math
import statistics
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from kine2go_warp.bench.choices import AblationConfig, Choice
from kine2go_warp.bench.trial import Trial, run_trial
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.files import atomic_file
from kine2go_warp.learning.presets import Preset
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.settings import content_hash, to_dictionary

COLUMNS = (
    ("reward", "reward", 100.0, "%", "mean"),
    ("survival", "survival", 100.0, "%", "mean"),
    ("noisy survival", "survival", 100.0, "%", "noisy"),
    ("joint RMSE", "joint_rmse", 1.0, "rad", "mean"),
    ("root error", "root_error", 100.0, "cm", "mean"),
    ("action rate", "action_rate", 1.0, "rad", "mean"),
    ("saturated", "torque_saturation", 100.0, "%", "mean"),
    ("power", "power", 1.0, "W", "mean"),
)
"""Title, name of the figure, factor, unit, and whether of rollouts with noise."""


@dataclass(frozen=True)
class Task:
    """One training that is wanted."""

    clip: MotionClip
    choice: Choice
    seed: int
    preset: Preset

    @property
    def key(self) -> str:
        """Hash of all that decides the result."""
        return content_hash(self.clip.content_hash(), to_dictionary(self.preset))

    @property
    def label(self) -> str:
        """What it is, in a few words."""
        return f"{self.clip.name} {self.choice.name} seed {self.seed}"


def tasks(clips: Sequence[MotionClip], choices: Sequence[Choice], config: AblationConfig) -> Iterator[Task]:
    """Yield the trainings, choice by choice, so that those that are done can be compared."""
    for choice in choices:
        for clip in clips:
            for seed in range(1, config.seeds + 1):
                yield Task(clip, choice, seed, config.preset(choice, seed))


def run_ablation(
    wanted: Iterable[Task],
    config: AblationConfig,
    results: Path,
    device: str,
    on_task: Callable[[Task], None],
    on_progress: Callable[..., None],
) -> None:
    """Run those trainings that the file of results lacks, and append each as it ends."""
    results.parent.mkdir(parents=True, exist_ok=True)
    known = read_results(results)
    # Written anew, so that a line that was cut short does not spoil the next one.
    with atomic_file(results) as temporary:
        temporary.write_text("".join(json.dumps(record) + "\n" for record in known), encoding="utf-8")
    done = {record["key"] for record in known}
    for task in wanted:
        if task.key in done:
            continue
        on_task(task)
        trial = run_trial(task.clip, task.preset, device, config.rollouts, on_progress)
        with results.open("a", encoding="utf-8") as file:
            file.write(json.dumps(record_of(task, trial)) + "\n")


def record_of(task: Task, trial: Trial) -> dict[str, Any]:
    """Return a result as JSON values."""
    return {
        "key": task.key,
        "motion": task.clip.name,
        "choice": task.choice.name,
        "seed": task.seed,
        "iterations": task.preset.ppo.iterations,
        **asdict(trial),
    }


def read_results(results: Path) -> list[dict[str, Any]]:
    """Read the results there are; a last line that was cut short by a kill does not count.

    Raises:
        Kine2GoError: another line is not a result.
    """
    lines = results.read_text(encoding="utf-8").splitlines() if results.exists() else []
    found = []
    for number, line in enumerate(lines, start=1):
        try:
            record = json.loads(line)
            is_result = {"key", "choice", "motion", "mean", "noisy"} <= set(record)
        except (ValueError, TypeError):
            is_result = False
        if is_result:
            found.append(record)
        elif number < len(lines):
            raise Kine2GoError(f"{results}, line {number}: not a result of 'kine2go ablate'")
    return found


def ablation_table(records: Sequence[dict[str, Any]], choices: Sequence[Choice]) -> str:
    """Return a Markdown table for each motion: the median over seeds, and least and greatest of the reward."""
    blocks = []
    for motion in dict.fromkeys(record["motion"] for record in records):
        titles = [f"{title} [{unit}]" for title, _, _, unit, _ in COLUMNS]
        rows = [["choice", *titles, "CPU [s]", "seeds"]]
        rows.append(["---"] * len(rows[0]))
        for choice in choices:
            found = [record for record in records if (record["motion"], record["choice"]) == (motion, choice.name)]
            if found:
                rows.append([f"`{choice.name}`", *table_row(found)])
        blocks.append(f"`{motion}`\n\n" + "\n".join(f"| {' | '.join(row)} |" for row in rows))
    return "\n\n".join(blocks) + "\n"


def table_row(found: Sequence[dict[str, Any]]) -> list[str]:
    """Return the cells of one choice from its results."""
    cells = []
    for _, name, factor, _, which in COLUMNS:
        values = [factor * value for record in found if not math.isnan(value := record[which][name])]
        text = number(statistics.median(values)) if values else "-"
        if name == "reward" and len(values) > 1:
            text += f" ({number(min(values))} to {number(max(values))})"
        cells.append(text)
    seconds = statistics.median(record["processor_seconds"] for record in found)
    return [*cells, f"{seconds:.0f}", str(len(found))]


def number(value: float) -> str:
    """Return a number with about three significant digits."""
    digits = 3 if abs(value) < 0.2 else 2 if abs(value) < 2.0 else 1 if abs(value) < 100.0 else 0
    return f"{value:.{digits}f}" if value else "0"
