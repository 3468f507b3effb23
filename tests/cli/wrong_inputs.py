"""Hundreds of wrong inputs, drawn over commands and kinds, and how the command line ends with each.

``python -m tests.cli.wrong_inputs DEMO`` takes the folder of a finished ``kine2go demo`` and prints the exceptions.
"""

import contextlib
import importlib
import io
import os
import signal
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from types import FrameType
from typing import get_args, get_type_hints

from kine2go_warp.cli.main import COMMANDS, imported, main
from kine2go_warp.metrics import FILTER_METRICS
from kine2go_warp.motions.catalogue import motion_named
from tests.cli.odd_inputs import new, odd_inputs
from tests.cli.wrong_files import (
    Good,
    wrong_catalogues,
    wrong_clips,
    wrong_datasets,
    wrong_motions,
    wrong_policies,
    wrong_recipes,
)

PATIENCE = 20
"""Longest processor time of one input [s]; what has not ended by then was accepted."""


@dataclass(frozen=True)
class WrongInput:
    """One input."""

    command: str
    kind: str
    arguments: tuple[str, ...]


@dataclass(frozen=True)
class Outcome:
    """How the command line ended."""

    given: WrongInput
    status: int | str
    errors: str
    left: tuple[str, ...]
    """Temporary files that stayed."""

    @property
    def is_good(self) -> bool:
        """Whether it is one line and status 2; a check of a dataset may also report what is wrong, with status 1."""
        reported = self.given.command == "dataset check" and self.status == 1 and not self.errors
        said = self.status == 2 and self.errors.count("\n") == 1 and self.errors.startswith("kine2go: error: ")
        return (reported or said) and not self.left and not any(ord(one) < 32 for one in self.errors.strip("\n"))


def ways(good: Good) -> dict[str, list[tuple[str, list[str]]]]:
    """Return for each kind of file the commands that read it, with ``@`` in its place."""
    motion = good.motion
    return {
        "dataset": [
            ("dataset check", ["@"]),
            ("dataset review", ["@", "--save", "--out", "recordings"]),
            ("dataset review", ["@", "--step"]),
            ("dataset review", ["@", "--reject", motion, "--why", "x"]),
            ("dataset score", ["@"]),
            ("dataset quality", ["@"]),
            ("dataset replay", ["@"]),
            ("dataset report", ["@", "--no-pictures", "--out", "page.html"]),
            ("dataset render", ["@", motion, "0", "--out", "a.mp4"]),
            ("dataset export", ["@", "--format", "npz", "--out", "npz"]),
            ("dataset export", ["@", "--format", "lerobot", "--out", "lerobot"]),
            ("dataset benchmark", ["@", "--policy", str(good.policy)]),
            ("dataset publish", ["@", "--to", "published", "--no-pictures"]),
            ("bench", ["load", "--dataset", "@"]),
        ],
        "clip": [
            ("policy train", ["@", "--out", "policy"]),
            ("policy ablate", ["@", "--out", "ablation"]),
            ("policy eval", [str(good.policy), "--clips", "@"]),
            ("dataset gather", [str(good.policy), "--clips", "@", "--out", "gathered.zarr"]),
            ("motion export", ["@", "--out", "exported"]),
            ("dataset review", ["@", "--save", "--out", "recordings"]),
        ],
        "policy": [
            ("policy eval", ["@"]),
            ("policy sim2sim", ["@"]),
            ("policy export", ["@", "--out", "exported"]),
            ("dataset gather", ["@", "--out", "gathered.zarr"]),
            ("dataset benchmark", [str(good.dataset), "--policy", "@"]),
        ],
        "recipe": [("run", ["@", "--out", "run"]), ("status", ["@", "--out", "run"])],
        "catalogue": [
            ("motion retarget", ["--all", "--catalogue", "@", "--out", "clips"]),
            ("motion sources", ["list", "--catalogue", "@"]),
            ("status", ["@", "--out", "run"]),
        ],
        "motion": [
            ("motion new", ["@", "--out", "new.toml"]),
            ("motion cycles", ["@"]),
            ("motion discover", ["@", "--licence", "own", "--out", "found.toml"]),
            ("motion retarget", ["@", "--licence", "own", "--out", "clips"]),
        ],
    }


def file_inputs(good: Good, folder: Path) -> Iterator[WrongInput]:
    """Yield every wrong file given to every command that reads its kind."""
    made = {
        "dataset": wrong_datasets(good, new(folder / "datasets")),
        "clip": wrong_clips(good, new(folder / "clips")),
        "policy": wrong_policies(good, new(folder / "policies")),
        "recipe": wrong_recipes(new(folder / "recipes")),
        "catalogue": wrong_catalogues(new(folder / "catalogues")),
        "motion": wrong_motions(new(folder / "motions")),
    }
    for what, commands in ways(good).items():
        for kind, path in list(made[what]):
            for command, words in commands:
                arguments = [str(path) if word == "@" else word for word in words]
                yield WrongInput(command, f"{what}: {kind}", (*command.split(), *arguments))


FIRST = {
    "demo": [], "run": ["demo"], "status": ["demo"], "motion retarget": ["dog_trot"], "motion cycles": ["FILE"],
    "motion discover": ["FILE", "--licence", "own"], "motion new": ["FILE"],
    "policy train": ["CLIP"], "policy eval": ["POLICY"], "policy sim2sim": ["POLICY"], "policy ablate": ["CLIP"],
    "dataset gather": ["POLICY"], "dataset review": ["DATASET", "--save"], "dataset replay": ["DATASET"],
    "dataset render": ["DATASET", "MOTION", "--out", "a.mp4"], "bench": ["retarget"],
    "dataset benchmark": ["DATASET", "--policy", "POLICY"], "deploy": ["POLICY", "--network", "lo"],
}  # fmt: skip
"""Commands with numbers for options, and what they need before."""

LARGE_IS_FINE = {
    "motion cycles": {"--count", "--longest", "--travel"},
    "dataset replay": {"--count"},
    "dataset review": {"--trajectories"},
    "bench": {"--num-worlds", "--steps", "--rows", "--repeats", "--processes"},
    "dataset render": {"--end", "--columns"},
    "policy ablate": {"--processes"},
    "policy train": {"--processes"},
    "run": {"--workers"},
    "dataset gather": {"--" + limit.setting.replace("_", "-") for limit in FILTER_METRICS},
}
"""Numbers without an upper end: as many as there are or as there is time for, and limits that are switched off."""

NEGATIVE_IS_FINE = {"motion cycles": {"--travel"}}


def numeric_options(kind: type) -> Iterator[tuple[str, type]]:
    """Yield the names and types of the options that are numbers, those of the settings among them."""
    hints = get_type_hints(kind)
    for field in fields(kind):
        hint, name = hints[field.name], "--" + field.name.replace("_", "-")
        number = next((one for one in (hint, *get_args(hint)) if one in (int, float)), None)
        if number is not None and bool not in (hint, *get_args(hint)) and field.name != "trajectory":
            yield name, number
        elif is_dataclass(hint) and field.name == "config":
            yield from numeric_options(hint)  # type: ignore[arg-type]


def number_inputs(good: Good) -> Iterator[WrongInput]:
    """Yield every number among the options with texts, numbers that are not finite, and such out of any range."""
    there = {"CLIP": good.clip, "POLICY": good.policy, "DATASET": good.dataset, "MOTION": good.motion}
    for command, words in FIRST.items():
        before = [str(there.get(word, word)) for word in words]
        for name, number in numeric_options(imported(command)):
            values = {"a text": "many", "not a number": "nan", "endless": "inf"}
            if name not in NEGATIVE_IS_FINE.get(command, ()):
                values["far below zero"] = "-1000000000"
            if name not in LARGE_IS_FINE.get(command, ()):
                values["far too large"] = "1" + "0" * 20 if number is int else "1e30"
            for kind, value in values.items():
                yield WrongInput(command, f"number: {kind}", (*command.split(), *before, f"{name}={value}"))


def word_inputs(good: Good) -> Iterator[WrongInput]:
    """Yield commands with options that there are not, without what they need, and names of nothing."""
    clip, policy, dataset, motion = str(good.clip), str(good.policy), str(good.dataset), good.motion
    needed = {**FIRST, "dataset check": ["DATASET"], "dataset score": ["DATASET"], "dataset export": ["DATASET"]}
    for command in COMMANDS:
        words = [dataset if word == "DATASET" else word for word in needed.get(command, [])]
        yield WrongInput(command, "word: an unknown option", (*command.split(), *words, "--sped"))
        first = command.split()[-1]
        yield WrongInput("", "word: a mistyped command", (*command.split()[:-1], first[:-1] + "xq"))
    names = {"unknown": "wolf", "a path": f"../{motion}", "empty": "", "an escape": "\x1b[31mx", "markup": "[/x]"}
    for kind, name in names.items():
        for command, words in (
            ("motion retarget", [name]),
            ("motion sources", ["check", name]),
            ("dataset check", [dataset, name]),
            ("dataset score", [dataset, name]),
            ("dataset quality", [dataset, name]),
            ("dataset replay", [dataset, name]),
            ("dataset report", [dataset, name, "--no-pictures", "--out", "page.html"]),
            ("dataset render", [dataset, name, "--out", "a.mp4"]),
            ("dataset export", [dataset, name, "--format", "npz", "--out", "npz"]),
            ("dataset review", [dataset, name, "--save"]),
            ("dataset review", [dataset, "--reject", name, "--why", "x"]),
            ("dataset gather", [policy, "--motions", name, "--out", "gathered.zarr"]),
            ("run", ["demo", "--motions", name, "--out", "run"]),
            ("policy train", [clip, "--preset", name, "--out", "policy"]),
            ("policy train", [clip, "--device", name, "--out", "policy"]),
            ("policy ablate", [clip, "--variants", name, "--out", "ablation"]),
        ):
            yield WrongInput(command, f"name: {kind}", (*command.split(), *words))


def drawn(good: Good, folder: Path) -> list[WrongInput]:
    """Return all wrong inputs; the files among them are made in a folder."""
    inputs = [*file_inputs(good, folder), *number_inputs(good), *word_inputs(good)]
    source = motion_named("dog_trot").path(None)
    for command, kind, words in odd_inputs(good, source, folder / "odd"):
        inputs.append(WrongInput(command, kind, (*command.split(), *words)))
    return inputs


class RanOn(BaseException):
    """An input took too long to be refused."""


def run_on(_number: int, _frame: FrameType | None) -> None:
    """End an input that takes too long."""
    raise RanOn


def warm_up() -> None:
    """Import what is large: an import that is cut short would spoil those of later inputs."""
    for module in (
        *("torch._dynamo", "kine2go_warp.evaluation.sim2sim", "kine2go_warp.deployment.export"),
        *("kine2go_warp.rollouts.replay", "kine2go_warp.recordings.motion", "kine2go_warp.reports.report"),
        *("kine2go_warp.exports.lerobot", "kine2go_warp.bench.loading", "kine2go_warp.motions.inverse_kinematics"),
    ):
        importlib.import_module(module)


def end_of(given: WrongInput, folder: Path) -> Outcome:
    """Give an input to the command line in this process and return how that ends."""
    shown, errors = io.StringIO(), io.StringIO()
    before, stdin = Path.cwd(), sys.stdin
    os.chdir(folder)
    sys.stdin = io.StringIO()
    signal.signal(signal.SIGPROF, run_on)
    signal.setitimer(signal.ITIMER_PROF, PATIENCE)
    status: int | str
    try:
        with contextlib.redirect_stdout(shown), contextlib.redirect_stderr(errors):
            status = main(list(given.arguments))
    except RanOn:
        status = "ran on"
    except SystemExit as end:
        status = f"exit {end.code}"
    except BaseException as error:  # noqa: BLE001 - a traceback is what is looked for
        status = f"{error.__class__.__name__}: {error} at {traceback.extract_tb(error.__traceback__)[-1]}"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        os.chdir(before)
        sys.stdin = stdin
    left = tuple(str(path) for path in folder.rglob(".tmp-*"))
    return Outcome(given, status, errors.getvalue(), left)


def report(outcomes: list[Outcome]) -> str:
    """Return how many ended well, by kind of input, and the others."""
    bad = [one for one in outcomes if not one.is_good]
    lines = [f"{len(outcomes) - len(bad)} of {len(outcomes)} ended with one line and status 2"]
    for kind, count in Counter(one.given.kind.partition(":")[0] for one in outcomes).items():
        wrong = sum(one.given.kind.startswith(kind) for one in bad)
        lines.append(f"  {kind}: {count - wrong} of {count}")
    for one in bad:
        said = one.errors.strip().replace("\n", " | ")[-300:]
        arguments = " ".join(one.given.arguments)[:200]
        lines.append(f"{one.status} <- kine2go {arguments!r} ({one.given.kind}) {said} {one.left or ''}")
    return "\n".join(lines)


if __name__ == "__main__":
    demo = Path(sys.argv[1]).resolve()
    clip = next((demo / "clips").glob("*.npz"))
    materials = Good(clip.resolve(), next((demo / "policies").iterdir()).resolve(), demo / "dataset.zarr", clip.stem)
    with tempfile.TemporaryDirectory() as name:
        inputs = drawn(materials, Path(name) / "inputs")
        if len(sys.argv) > 2:
            inputs = [one for one in inputs if sys.argv[2] in " ".join((one.kind, *one.arguments))]
        warm_up()
        work = new(Path(name) / "work")
        ended = []
        for one in inputs:
            ended.append(end_of(one, work))
            print("." if ended[-1].is_good else report(ended[-1:]), end="", file=sys.stderr, flush=True)
        print(report(ended))
