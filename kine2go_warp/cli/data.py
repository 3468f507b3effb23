"""Arguments that several commands take, and where the source clips are."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from kine2go_warp.errors import CatalogueError, ClipError, Kine2GoError
from kine2go_warp.motions.keypoints import RATES
from kine2go_warp.names import check_distinct

if TYPE_CHECKING:
    from kine2go_warp.dataset.motion import Motion
    from kine2go_warp.motions.clip import MotionClip

DATA_VARIABLE = "KINE2GO_DATA"

DatasetPath = Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="DATASET")]
PolicyPath = Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="POLICY")]
ClipPaths = Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="CLIP [CLIP ...]")]
OtherClips = Annotated[
    tuple[Path, ...],
    tyro.conf.arg(
        metavar="[CLIP [CLIP ...]]",
        help="Clips (.npz) to track instead of those that the policy was trained on.",
    ),
]
Device = Annotated[
    str | None,
    tyro.conf.arg(metavar="{cpu,cuda,cuda:1}", help="Where to simulate; by default cuda where there is one."),
]
DataFolder = Annotated[
    Path | None,
    tyro.conf.arg(
        metavar="FOLDER", help="Folder of the source clips; by default the environment variable KINE2GO_DATA."
    ),
]
Robot = Annotated[str, tyro.conf.arg(metavar="ROBOT", help="Name of the robot, or FILE.py:NAME for one of your own.")]
CatalogueFile = Annotated[
    Path | None, tyro.conf.arg(metavar="FILE", help="TOML file with motions of your own, in the form of the catalogue.")
]
TargetPath = Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="DATASET|CLIP")]
RecipePath = Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="RECIPE")]
ChosenMotions = Annotated[tuple[str, ...], tyro.conf.arg(metavar="[MOTION ...]")]
MotionNames = Annotated[tyro.conf.Positional[tuple[str, ...]], tyro.conf.arg(metavar="[MOTION ...]")]


def data_folder(given: Path | None) -> Path | None:
    """Return the folder of the source clips: the one given, or that of the environment variable.

    Raises:
        CatalogueError: it does not exist.
    """
    folder = given or (Path(os.environ[DATA_VARIABLE]) if os.environ.get(DATA_VARIABLE) else None)
    if folder is not None and not folder.is_dir():
        raise CatalogueError(f"{folder}: no such folder of source clips")
    return folder


def read_clips(paths: Sequence[Path]) -> "list[MotionClip]":
    """Read clips.

    Raises:
        ClipError: one cannot be read, or two have the same name.
    """
    from kine2go_warp.motions.clip import MotionClip

    clips = [MotionClip.load(path) for path in paths]
    check_distinct([clip.name for clip in clips], ClipError)
    return clips


def read_named_clips(paths: Sequence[Path]) -> "list[MotionClip]":
    """Read clips as ``read_clips`` does, at least one.

    Raises:
        ClipError: none is named, one cannot be read, or two have the same name.
    """
    if not paths:
        raise ClipError("name at least one clip; 'kine2go motion retarget' makes them")
    return read_clips(paths)


def check_data(motion: "Motion") -> None:
    """Check that the arrays of a motion are there, by its first trajectory, before long work begins.

    Raises:
        DatasetError: an array cannot be read, or data are missing.
    """
    for _ in motion.read([one for one in motion.references() if one.length > 0][:1], None):
        pass


def rate_in_hz(given: float | None) -> float:
    """Return the frame rate that an option states [Hz], 0 if it is left out.

    Raises:
        Kine2GoError: no motion has such a rate.
    """
    if given is not None and not RATES[0] <= given <= RATES[1]:
        raise Kine2GoError(f"--rate {given:g}: choose {RATES[0]:g} to {RATES[1]:g} Hz")
    return given or 0.0
