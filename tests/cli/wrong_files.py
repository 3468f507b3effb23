"""Files that no command can use: datasets, clips, policies and recipes, each with what is wrong with it."""

import json
import pickle
import shutil
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import zarr


@dataclass(frozen=True)
class Good:
    """What wrong inputs are made of."""

    clip: Path
    policy: Path
    dataset: Path
    motion: str


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
        kept = shutil.ignore_patterns("export")  # which has all that it needs of the policy
        path = Path(shutil.copytree(good.policy, folder / name.replace(" ", "_"), ignore=kept))
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


GOOD_MOTION: dict[str, object] = {
    "name": "one", "file": "dog.txt", "source": "ai4animation", "licence": "own", "citation": "",
}  # fmt: skip
"""A motion of one's own, as a catalogue has it."""

MOTIONS: dict[str, dict[str, object]] = {
    "an unknown key": {"colour": "red"},
    "no licence": {"licence": " "},
    "a name that is a path": {"name": "../one"},
    "a name with a control character": {"name": "one\x1b[31m"},
    "a number for a name": {"name": 3},
    "a collection that there is not": {"collection": "mine", "source": None, "licence": None, "citation": None},
    "an unknown kind": {"kind": "twice"},
    "a hold of a cycle": {"hold": 1.0},
    "a negative hold": {"kind": "once", "hold": -1.0},
    "an endless hold": {"kind": "once", "hold": float("inf")},
    "a hold as a text": {"kind": "once", "hold": "long"},
    "an unknown mode": {"mode": "magic"},
    "no rate": {"rate": 0.0},
    "a rate that is not a number": {"rate": float("nan")},
    "a scale of nothing": {"scale": 0.0},
    "a negative time scale": {"time_scale": -1.0},
    "a time scale as a text": {"time_scale": "slow"},
    "an end as a text": {"end": "last"},
    "a mirror as a number": {"mirror": 2},
    "a length as a text": {"length": "long"},
}
"""What replaces or joins the keys of a motion; None leaves one out."""

PARTS: dict[str, object] = {
    "an unknown part": ["one", "wolf"],
    "itself as a part": ["one", "walk"],
    "one part": ["one"],
    "no parts": [],
    "parts as a text": "one",
    "a part as a number": ["one", 3],
    "cycles and seconds": ["one", {"motion": "dog_trot", "cycles": 2, "seconds": 3.0}],
    "fewer than no cycles": ["one", {"motion": "dog_trot", "cycles": -1}],
    "endless seconds": ["one", {"motion": "dog_trot", "seconds": float("inf")}],
    "a part with another key": ["one", {"motion": "dog_trot", "times": 2}],
    "repeats of what is played once": ["one", {"motion": "dog_sit_down", "cycles": 2}],
}
"""Of a sequence ``walk`` of motions."""

SOURCES = {
    "a source without points": 'format = "bvh"',
    "a source of an unknown format": 'format = "fbx"',
    "a source in an unknown unit": 'format = "bvh"\nunit = "yards"',
    "a source as a text": None,
}


def wrong_catalogues(folder: Path) -> Iterator[tuple[str, Path]]:
    """Yield catalogues that cannot be used, by what is wrong; each could be a recipe as well."""

    def table(values: dict[str, object]) -> str:
        return "\n".join(["[[motion]]", *(f"{key} = {toml(one)}" for key, one in values.items() if one is not None)])

    texts = {name: table({**GOOD_MOTION, **changed}) for name, changed in MOTIONS.items()}
    for name, parts in PARTS.items():
        texts[name] = f"{table(GOOD_MOTION)}\n{table({'name': 'walk', 'parts': parts})}"
    for name, text in SOURCES.items():
        described = 'source = "bvh"' if text is None else f"[source.mine]\n{text}"
        texts[name] = f"{described}\n{table(GOOD_MOTION)}"
    texts["a motion twice"] = f"{table(GOOD_MOTION)}\n{table(GOOD_MOTION)}"
    texts["a motion without a file"] = table({**GOOD_MOTION, "file": None})
    texts["no TOML in a catalogue"] = "[[motion"
    for name, text in texts.items():
        path = folder / f"{name.replace(' ', '_')}.toml"
        path.write_text(f'name = "own"\n{text}')
        yield name, path
    yield "no catalogue", folder / "nowhere.toml"
    yield "a folder as a catalogue", folder


def toml(value: object) -> str:
    """Return a value as TOML."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml(one)}" for key, one in value.items()) + " }"
    if isinstance(value, list):
        return f"[{', '.join(map(toml, value))}]"
    return repr(value) if isinstance(value, float) else json.dumps(value)


def wrong_motions(folder: Path) -> Iterator[tuple[str, Path]]:
    """Yield motion files that cannot be used, by what is wrong."""
    bvh = "HIERARCHY\nROOT Hips\n{\n OFFSET 0 0 0\n CHANNELS 3 Xposition Yposition Zposition\n}\nMOTION\nFrames: 3\n"
    contents = {
        "nothing.txt": b"",
        "words.txt": b"a dog\nand a horse\n",
        "a rectangle of zeros.txt": b"0 0 0\n" * 40,
        "control characters.csv": b"a\x1b[31m,b\n1,2\n",
        "a heading alone.csv": b"time,pelvis_x,pelvis_y,pelvis_z\n",
        "no numbers.csv": b"pelvis_x,pelvis_y,pelvis_z\n" + b"a,b,c\n" * 20,
        "cut off.json": b'{"Frames": [[0.0, 1.0',
        "no frames.json": b'{"FrameDuration": 0.02}',
        "unequal frames.json": b'{"FrameDuration": 0.02, "Frames": [[0.0, 1.0], [2.0]]}',
        "cut off.bvh": bvh[:60].encode(),
        "no frames.bvh": bvh.encode(),
        "no header.c3d": bytes(range(256)) * 4,
        "a text.npz": b"no arrays",
        "a text.parquet": b"PAR1",
        "a pickle that runs.pkl": pickle.dumps(Runs()),
        "a text.pt": b"no tensor",
        "another kind.png": b"\x89PNG\r\n\x1a\n",
    }
    for name, content in contents.items():
        path = folder / name.replace(" ", "_")
        path.write_bytes(content)
        yield name, path
    np.savez(folder / "objects.npz", pelvis=np.array([{}], dtype=object))
    yield "pickled objects", folder / "objects.npz"
    yield "no motion file", folder / "nowhere.bvh"
    (folder / "folder.bvh").mkdir()
    yield "a folder as a motion file", folder / "folder.bvh"


class Runs:
    """A pickle of it would run a command."""

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        return exec, ("raise SystemExit('a pickle was run')",)
