"""Hundreds of wrong inputs, drawn over commands and kinds, and how the command line ends with each.

``python -m tests.cli.wrong_inputs DEMO`` takes the folder of a finished ``kine2go demo`` and prints the exceptions.
"""

import contextlib
import importlib
import io
import json
import os
import pickle
import shutil
import signal
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from types import FrameType
from typing import get_args, get_type_hints

import numpy as np
import zarr

from kine2go_warp.cli.main import COMMANDS, imported, main
from kine2go_warp.metrics import FILTER_METRICS

PATIENCE = 20
"""Longest processor time of one input [s]; what has not ended by then was accepted."""


@dataclass(frozen=True)
class Good:
    """What wrong inputs are made of."""

    clip: Path
    policy: Path
    dataset: Path
    motion: str


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


def wrong_datasets(good: Good, folder: Path) -> Iterator[tuple[str, Path]]:
    """Yield datasets that cannot be used, by what is wrong."""

    def spoiled(name: str, spoil: Callable[[Path], None]) -> tuple[str, Path]:
        path = Path(shutil.copytree(good.dataset, folder / f"{name.replace(' ', '_')}.zarr"))
        spoil(path)
        return name, path

    def attributes(path: Path, **values: object) -> None:
        content = json.loads((path / "zarr.json").read_text())
        content["attributes"].update(values)
        (path / "zarr.json").write_text(json.dumps(content))

    def cut(path: Path) -> None:
        chunk = next(one for one in sorted((path / good.motion / "joint_position" / "c").rglob("*")) if one.is_file())
        chunk.write_bytes(chunk.read_bytes()[:40])

    yield "no dataset", folder / "nowhere.zarr"
    yield "a name with a control character", folder / "no\x1b[31mwhere.zarr"
    (folder / "empty.zarr").mkdir()
    yield "an empty folder", folder / "empty.zarr"
    (folder / "text.zarr").write_text("no dataset")
    yield "a text file", folder / "text.zarr"
    zarr.create_group(folder / "other.zarr")
    yield "another Zarr store", folder / "other.zarr"
    yield spoiled("another format version", lambda path: attributes(path, format_version="99"))
    yield spoiled("a root that is cut off", lambda path: (path / "zarr.json").write_text("{"))
    yield spoiled("a motion that is cut off", lambda path: (path / good.motion / "zarr.json").write_text("{"))
    yield spoiled("a missing array", lambda path: shutil.rmtree(path / good.motion / "joint_position"))
    yield spoiled("a missing chunk", lambda path: shutil.rmtree(path / good.motion / "joint_position" / "c"))
    yield spoiled("a chunk that is cut off", cut)
    yield spoiled("a file of verdicts that is none", lambda path: (path / "verdicts.json").write_text("{\x1b"))
    yield spoiled("an unknown robot", lambda path: attributes(path, robot="wolf", robot_reference="wolf"))


def wrong_clips(good: Good, folder: Path) -> Iterator[tuple[str, Path]]:
    """Yield clips that cannot be used, by what is wrong."""
    with np.load(good.clip) as file:
        arrays = dict(file)
    (header,) = [name for name, values in arrays.items() if values.dtype.kind in "US" and values.ndim == 0]
    meta = json.loads(str(arrays[header]))

    def saved(wrong: str, changed: dict[str, object], **values: object) -> tuple[str, Path]:
        path = folder / f"{wrong.replace(' ', '_')}.npz"
        np.savez(path, **{**arrays, **changed, header: json.dumps({**meta, **values})})  # type: ignore[arg-type]
        return wrong, path

    joints, root = arrays["joint_position"], arrays["root_position"]
    yield "no clip", folder / "nowhere.npz"
    for name, content in {
        "text": b"no clip",
        "nothing": b"",
        "a table": b"a,b\n1,2\n",
        "a pickle": pickle.dumps([1]),
    }.items():
        path = folder / f"{name.replace(' ', '_')}.npz"
        path.write_bytes(content)
        yield name, path
    (folder / "folder.npz").mkdir()
    yield "a folder", folder / "folder.npz"
    np.savez(folder / "bare.npz", joint_position=joints)
    yield "no header", folder / "bare.npz"
    np.savez(folder / "objects.npz", **{**arrays, "joint_position": np.array([{}], dtype=object)})  # type: ignore
    yield "pickled objects", folder / "objects.npz"
    yield saved("eight joints", {"joint_position": joints[:, :8]})
    yield saved("joints as texts", {"joint_position": joints.astype(str)})
    yield saved("numbers that are not finite", {"joint_position": np.where(joints == joints[3, 3], np.nan, joints)})
    yield saved("degrees", {"joint_position": np.degrees(joints)})
    yield saved("unequal frames", {"joint_position": joints[:-3]})
    yield saved(
        "one frame", {name: values[:1] for name, values in arrays.items() if values.ndim and len(values) == len(root)}
    )
    yield saved("orientations of length zero", {"root_orientation": np.zeros_like(arrays["root_orientation"])})
    yield saved("a robot in the sky", {"root_position": root + np.array([0.0, 0.0, 50.0])})
    for name, value in {
        "a path": "../../evil",
        "a whole path": "/tmp/evil",
        "an escape": "\x1b[31m",
        "no name": "",
    }.items():
        yield saved(f"{name} for a name", {}, name=value)
    for name, value in {"no": 0.0, "a negative": -0.016, "a text as": "x"}.items():
        yield saved(f"{name} frame duration", {}, frame_duration=value)


def wrong_policies(good: Good, folder: Path) -> Iterator[tuple[str, Path]]:
    """Yield policy folders that cannot be used, by what is wrong."""

    def spoiled(name: str, spoil: Callable[[Path], None]) -> tuple[str, Path]:
        path = Path(shutil.copytree(good.policy, folder / name.replace(" ", "_")))
        spoil(path)
        return name, path

    def swap(path: Path) -> None:
        with np.load(good.clip) as file:
            arrays = dict(file)
        clip = next(path.glob("*.npz"))
        arrays["joint_position"] = arrays["joint_position"] + 1e-3
        np.savez(clip, **arrays)

    yield "no policy", folder / "nowhere"
    (folder / "empty").mkdir()
    yield "an empty folder", folder / "empty"
    (folder / "file").write_text("no policy")
    yield "a file", folder / "file"
    yield spoiled("settings that are no JSON", lambda path: (path / "policy.json").write_text("{"))
    yield spoiled("settings of another format", lambda path: (path / "policy.json").write_text('{"format": 99}'))
    yield spoiled("no clip", lambda path: each(path.glob("*.npz"), Path.unlink))
    yield spoiled("another clip", swap)
    yield spoiled("no checkpoint", lambda path: each(path.rglob("*.pt"), Path.unlink))
    pickled = pickle.dumps([1])
    yield spoiled("a pickle", lambda path: each(path.rglob("*.pt"), lambda one: one.write_bytes(pickled)))
    yield spoiled("a cut", lambda path: each(path.rglob("*.pt"), lambda one: one.write_bytes(one.read_bytes()[:99])))


def each(paths: Iterable[Path], spoil: Callable[[Path], object]) -> None:
    """Spoil each of some files."""
    for path in list(paths):
        spoil(path)


RECIPES = {
    "no TOML": "name = ",
    "another key": 'colour = "red"',
    "a key of another section": "[train]\nepochs = 3",
    "no motions": "motions = []",
    "motions as a text": 'motions = "dog_trot"',
    "motions as numbers": "motions = [1, 2]",
    "a motion twice": 'motions = ["dog_trot", "dog_trot"]',
    "an unknown motion": 'motions = ["wolf"]',
    "a motion that is a path": 'motions = ["../dog_trot"]',
    "a name that is a path": 'name = "../a"',
    "no name": 'name = ""',
    "an unknown preset": '[train]\npreset = "turbo"',
    "an unknown robot": 'robot = "wolf"',
    "no catalogue": 'catalogue = "nowhere.toml"',
    "a clip to accept that is no motion": 'accept = ["wolf"]',
    "negative iterations": "[train.ppo]\niterations = -2",
    "too many iterations": "[train.ppo]\niterations = 10000000000000000000000",
    "iterations as a text": '[train.ppo]\niterations = "many"',
    "too many worlds": "[train.env]\nnum_worlds = 1000000000",
    "a negative seed": "[train.env]\nseed = -5",
    "a rate that is not a number": "[train.ppo]\ngamma = nan",
    "an infinite time": "[gather]\nwarm_up = inf",
    "too many trajectories": "[gather]\ntrajectories = 100000000",
    "no trajectories": "[gather]\ntrajectories = 0",
    "a list of three for two": "[gather]\naction_noise_scale = [1, 0, 2]",
    "a switch as a number": "[score]\nenabled = 3",
    "fewer than no recordings": "[record]\ntrajectories = -1",
    "an unknown mode": '[retarget]\nmode = "magic"',
    "smoothing below zero": "[retarget]\nsmoothing = -1.0",
    "a section for a number": "[gather.trajectories]\na = 1",
    "an unknown terrain": '[train.env.terrain]\nkind = "moon"',
}
"""What replaces or joins name and motions of a recipe, by what is wrong."""


def wrong_recipes(folder: Path) -> Iterator[tuple[str, Path]]:
    """Yield recipes that cannot be used, by what is wrong."""
    for name, text in RECIPES.items():
        path = folder / f"{name.replace(' ', '_')}.toml"
        good = {"name": 'name = "a"', "motions": 'motions = ["dog_trot"]'}
        kept = [line for key, line in good.items() if not text.startswith(f"{key} =")]
        kept.insert(len(kept) if text.startswith("[") else 0, text)
        path.write_text("\n".join(kept))
        yield name, path
    yield "no recipe", folder / "nowhere.toml"
    yield "a folder", folder
    (folder / "binary.toml").write_bytes(bytes(range(256)))
    yield "no text", folder / "binary.toml"


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
            ("bench", ["load", "--dataset", "@"]),
        ],
        "clip": [
            ("policy train", ["@", "--out", "policy"]),
            ("policy ablate", ["@", "--out", "ablation"]),
            ("dataset review", ["@", "--save", "--out", "recordings"]),
        ],
        "policy": [
            ("policy eval", ["@"]),
            ("policy sim2sim", ["@"]),
            ("policy export", ["@", "--out", "exported"]),
            ("dataset gather", ["@", "--out", "gathered.zarr"]),
        ],
        "recipe": [("run", ["@", "--out", "run"]), ("status", ["@", "--out", "run"])],
    }


def file_inputs(good: Good, folder: Path) -> Iterator[WrongInput]:
    """Yield every wrong file given to every command that reads its kind."""
    made = {
        "dataset": wrong_datasets(good, new(folder / "datasets")),
        "clip": wrong_clips(good, new(folder / "clips")),
        "policy": wrong_policies(good, new(folder / "policies")),
        "recipe": wrong_recipes(new(folder / "recipes")),
    }
    for what, commands in ways(good).items():
        for kind, path in list(made[what]):
            for command, words in commands:
                arguments = [str(path) if word == "@" else word for word in words]
                yield WrongInput(command, f"{what}: {kind}", (*command.split(), *arguments))


FIRST = {
    "demo": [], "run": ["demo"], "status": ["demo"], "motion retarget": ["dog_trot"], "motion cycles": ["FILE"],
    "policy train": ["CLIP"], "policy eval": ["POLICY"], "policy sim2sim": ["POLICY"], "policy ablate": ["CLIP"],
    "dataset gather": ["POLICY"], "dataset review": ["DATASET", "--save"], "dataset replay": ["DATASET"],
    "dataset render": ["DATASET", "MOTION", "--out", "a.mp4"], "bench": ["retarget"],
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
    return [*file_inputs(good, folder), *number_inputs(good), *word_inputs(good)]


def new(folder: Path) -> Path:
    """Make a folder and return it."""
    folder.mkdir(parents=True)
    return folder


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
