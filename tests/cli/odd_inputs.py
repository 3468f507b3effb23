"""Paths and words that fit no command: what is no plain file, what is in the way of a result, options given oddly."""

import gzip
import lzma
import os
import socket
from collections.abc import Iterator
from pathlib import Path

from tests.cli.wrong_files import Good

READERS = [
    ("policy train", ["@", "--out", "policy"]),
    ("policy train", ["{clip}", "--config", "@", "--out", "policy"]),
    ("policy train", ["{clip}", "--initial-policy", "@", "--out", "policy"]),
    ("policy eval", ["@"]),
    ("policy eval", ["{policy}", "--clips", "@"]),
    ("policy sim2sim", ["@"]),
    ("policy sim2sim", ["{policy}", "--exported", "@"]),
    ("policy export", ["@", "--out", "exported"]),
    ("policy ablate", ["{clip}", "--file", "@", "--out", "ablation"]),
    ("dataset gather", ["@", "--out", "gathered.zarr"]),
    ("dataset gather", ["{policy}", "--clips", "@", "--out", "gathered.zarr"]),
    ("dataset check", ["@"]),
    ("dataset score", ["@"]),
    ("dataset quality", ["@"]),
    ("dataset replay", ["@"]),
    ("dataset review", ["@", "--save", "--out", "recordings"]),
    ("dataset report", ["@", "--no-pictures", "--out", "page.html"]),
    ("dataset render", ["@", "{motion}", "0", "--out", "a.mp4"]),
    ("dataset render", ["{dataset}", "{motion}", "0", "--out", "a.mp4", "--meshes", "@"]),
    ("dataset benchmark", ["@", "--policy", "{policy}"]),
    ("dataset benchmark", ["{dataset}", "--policy", "@"]),
    ("dataset export", ["@", "--format", "npz", "--out", "npz"]),
    ("dataset publish", ["@", "--to", "published"]),
    ("motion retarget", ["--all", "--catalogue", "@", "--out", "clips"]),
    ("motion retarget", ["dog_trot", "--robot", "@:SPEC", "--out", "clips"]),
    ("motion retarget", ["@", "--licence", "own", "--out", "clips"]),
    ("motion new", ["@", "--out", "new.toml"]),
    ("motion cycles", ["@"]),
    ("motion discover", ["@", "--licence", "own", "--out", "found.toml"]),
    ("motion export", ["@", "--out", "exported"]),
    ("motion sources", ["list", "--catalogue", "@"]),
    ("motion sources", ["check", "--data", "@"]),
    ("doctor", ["--data", "@"]),
    ("doctor", ["--catalogue", "@"]),
    ("run", ["@", "--out", "run"]),
    ("run", ["demo", "--set", "catalogue=@", "--out", "run"]),
    ("status", ["@", "--out", "run"]),
    ("deploy", ["@", "--network", "lo"]),
    ("bench", ["env", "--clip", "@"]),
    ("bench", ["load", "--dataset", "@"]),
]
"""Commands that read a file or a folder, with ``@`` in its place."""

WRITERS = [
    ("policy train", ["{clip}", "--out", "@", "--iterations", "1", "--num-worlds", "8"]),
    ("policy eval", ["{policy}", "--json", "@", "--worlds", "8"]),
    ("policy sim2sim", ["{policy}", "--json", "@", "--worlds", "8"]),
    ("policy export", ["{policy}", "--out", "@"]),
    ("policy ablate", ["{clip}", "--out", "@", "--seeds", "1"]),
    ("dataset gather", ["{policy}", "--out", "@"]),
    ("dataset score", ["{dataset}", "--json", "@"]),
    ("dataset score", ["{dataset}", "--plots", "@"]),
    ("dataset quality", ["{dataset}", "--picture", "@"]),
    ("dataset review", ["{dataset}", "--save", "--out", "@"]),
    ("dataset report", ["{dataset}", "--no-pictures", "--out", "@"]),
    ("dataset render", ["{dataset}", "{motion}", "0", "--out", "@"]),
    ("dataset benchmark", ["{dataset}", "--policy", "{policy}", "--leaderboard", "@"]),
    ("dataset export", ["{dataset}", "--format", "npz", "--out", "@"]),
    ("dataset publish", ["{dataset}", "--no-pictures", "--to", "@"]),
    ("motion retarget", ["dog_trot", "--out", "@"]),
    ("motion retarget", ["dog_trot", "--out", "clips", "--markdown", "@"]),
    ("motion export", ["{clip}", "--format", "amp", "--out", "@"]),
    ("motion new", ["{source}", "--out", "@"]),
    ("motion discover", ["{source}", "--licence", "own", "--out", "@"]),
    ("run", ["demo", "--out", "@"]),
    ("status", ["demo", "--out", "run", "--markdown", "@"]),
]
"""Commands that write a file or a folder, with ``@`` in its place."""

WORDS = [
    ("policy train", ["{clip}", "--out", "a", "--out", "b"]),
    ("policy train", ["{clip}", "--num-worlds", "8", "--num-worlds"]),
    ("policy train", ["{clip}", "{clip}", "--out", "policy"]),
    ("policy train", ["{clip}", "--num-worlds", "\uff18x"]),
    ("policy train", ["{clip}", "--preset="]),
    ("policy train", ["{clip}", "--device", "cuda:-1"]),
    ("policy train", ["{clip}", "--overwrite=3"]),
    ("policy train", ["{clip}", "--env.reset.tilt"]),
    ("policy ablate", ["{clip}", "{clip}", "--out", "ablation"]),
    ("policy eval", ["{policy}", "{policy}"]),
    ("policy eval", ["{policy}", "--start", "middle"]),
    ("policy eval", ["{policy}", "--device", "gpu"]),
    ("policy sim2sim", ["{policy}", "--seconds", "1e400"]),
    ("dataset gather", ["{policy}", "--motions", "d\u043eg_trot", "--out", "g.zarr"]),
    ("dataset gather", ["{policy}", "--motions", "DOG_TROT", "--out", "g.zarr"]),
    ("dataset gather", ["{policy}", "--start-phases", "3", "1", "--out", "g.zarr"]),
    ("dataset score", ["{dataset}", "dog_trot "]),
    ("dataset review", ["{dataset}", "--save", "--web"]),
    ("dataset review", ["{dataset}", "--web", "--port", "70000"]),
    ("dataset review", ["{dataset}", "--reject", "{motion}/-1", "--why", "x"]),
    ("dataset review", ["{dataset}", "--reject", "{motion}/999", "--why", "x"]),
    ("dataset review", ["{dataset}", "--reject", "{motion}/0"]),
    ("dataset review", ["{dataset}", "--withdraw", "{motion}/x"]),
    ("dataset review", ["{dataset}", "--by", "beauty", "--save"]),
    ("dataset render", ["{dataset}", "{motion}", "-1", "--out", "a.mp4"]),
    ("dataset render", ["{dataset}", "{motion}", "999999", "--out", "a.mp4"]),
    ("dataset render", ["{dataset}", "{motion}", "0", "0", "--size", "0x0", "--out", "a.mp4"]),
    ("dataset render", ["{dataset}", "{motion}", "0", "--out", "a.avi"]),
    ("dataset render", ["{dataset}", "{motion}", "0", "--fps", "0", "--out", "a.mp4"]),
    ("dataset export", ["{dataset}", "--format", "NPZ", "--out", "n"]),
    ("dataset export", ["{dataset}", "--format", "", "--out", "n"]),
    ("dataset publish", ["{dataset}", "--to", "hf://datasets/one"]),
    ("dataset publish", ["{dataset}", "--to", ""]),
    ("dataset publish", ["{dataset}", "--to", "a", "--format", "zip"]),
    ("dataset benchmark", ["{dataset}"]),
    ("dataset benchmark", ["{dataset}", "--policy", "json:nothing"]),
    ("dataset benchmark", ["{dataset}", "--policy", "nothing_at_all:NAME"]),
    ("dataset benchmark", ["{dataset}", "--policy", "{policy}", "--engine", "bullet"]),
    ("motion retarget", ["dog_trot", "dog_trot", "--frames", "1:2", "--out", "clips"]),
    ("motion retarget", ["{source}", "--licence", "own", "--frames", "9:3", "--out", "clips"]),
    ("motion retarget", ["{source}", "--licence", "own", "--frames", "a:b", "--out", "clips"]),
    ("motion retarget", ["{source}", "--licence", "own", "--name", "../x", "--out", "clips"]),
    ("motion retarget", ["{source}", "--licence", "own", "--name", "a\u202eb", "--out", "clips"]),
    ("motion retarget", ["{source}", "--licence", " ", "--out", "clips"]),
    ("motion retarget", ["dog_trot", "--robot", "Go2", "--out", "clips"]),
    ("motion retarget", ["--all", "dog_trot", "--catalogue", "", "--out", "clips"]),
    ("motion export", ["{clip}", "--format", "npz", "--out", "m"]),
    ("motion export", ["{clip}", "{clip}", "--format", "amp", "--out", "m"]),
    ("motion export", ["--out", "m"]),
    ("motion sources", ["fetch", "ai4_dog_pace", "--url", "file:///etc", "--yes"]),
    ("motion sources", ["fetch", "ai4_dog_pace", "--url", "http://127.0.0.1:1", "--yes", "--data", "."]),
    ("motion discover", ["{source}", "--out", "f.toml"]),
    ("run", ["demo", "--set", "train.ppo.iterations"]),
    ("run", ["demo", "--set", "train.ppo.iterations=", "--out", "run"]),
    ("run", ["demo", "--set", "train.ppo.gamma=nan", "--out", "run"]),
    ("run", ["demo", "--set", "train.ppo.gamma=0.9", "train.ppo.gamma=0.8", "--out", "run"]),
    ("run", ["demo", "--set", "=", "--out", "run"]),
    ("run", ["demo", "--set", "a\u0000b=1", "--out", "run"]),
    ("run", ["demo", "--motions", "wolf_*", "--out", "run"]),
    ("run", ["demo", "--motions", "[", "--out", "run"]),
    ("run", ["demo", "--workers", "0", "--out", "run"]),
    ("status", ["demo", "--robot", "go3", "--out", "run"]),
    ("deploy", ["{policy}"]),
    ("deploy", ["{policy}", "--network", "lo", "--estimate", "gps"]),
    ("deploy", ["{policy}", "--network", "lo", "--seconds", "-1"]),
    ("bench", ["sweep", "--worlds", "0"]),
    ("bench", ["envy"]),
    ("bench", ["load"]),
    ("doctor", ["extra"]),
]
"""Words that are wrong in a way of their own."""


def odd_paths(folder: Path) -> Iterator[tuple[str, Path]]:
    """Yield what is no file or folder of ours."""
    (folder / "folder").mkdir()
    yield "a folder of nothing", folder / "folder"
    (folder / "loop").symlink_to(folder / "loop")
    yield "a link to itself", folder / "loop"
    (folder / "lost").symlink_to(folder / "nowhere")
    yield "a link to nothing", folder / "lost"
    before = Path.cwd()
    os.chdir(folder)  # the name of a socket is short
    with socket.socket(socket.AF_UNIX) as one:
        one.bind("socket")
    os.chdir(before)
    yield "a socket", folder / "socket"
    for name, content in {
        "nothing": b"",
        "gzip": gzip.compress(b"name = 'a'"),
        "xz": lzma.compress(b"name = 'a'"),
        "UTF-16": 'name = "a"\nmotions = ["dog_trot"]\n'.encode("utf-16"),
        "zeros": bytes(4096),
    }.items():
        (folder / name).write_bytes(content)
        yield f"a file of {name}", folder / name
    yield "below a file", folder / "nothing" / "x"
    yield "a name that is too long", folder / ("x" * 300)
    yield "no name", Path("//")


def wrong_places(folder: Path) -> Iterator[tuple[str, Path]]:
    """Yield where nothing can be written."""
    (folder / "file").write_text("mine")
    yield "below a file", folder / "file" / "x" / "a.json"
    (folder / "loop").symlink_to(folder / "loop")
    yield "below a link to itself", folder / "loop" / "a.json"
    yield "a name that is too long", folder / ("x" * 300)
    yield "in a folder that cannot be written to", Path("/proc/kine2go/a.json")


def odd_inputs(good: Good, source: Path, folder: Path) -> Iterator[tuple[str, str, list[str]]]:
    """Yield command, kind and arguments of odd inputs; files are made in a folder."""
    there = {"clip": good.clip, "policy": good.policy, "dataset": good.dataset, "motion": good.motion, "source": source}
    for made, commands, about in (
        (odd_paths(new(folder / "read")), READERS, "path"),
        (wrong_places(new(folder / "written")), WRITERS, "place"),
    ):
        for kind, path in list(made):
            for command, words in commands:
                yield command, f"{about}: {kind}", [one.format(**there).replace("@", str(path)) for one in words]
    for command, words in WORDS:
        yield command, "odd word: any", [one.format(**there) for one in words]


def new(folder: Path) -> Path:
    """Make a folder and return it."""
    folder.mkdir(parents=True)
    return folder
