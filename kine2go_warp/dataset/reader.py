"""Reading motions back from a store."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray

from kine2go_warp.dataset.schema import ROW_ARRAYS, SUB_GROUPS, TRAJECTORY_ARRAYS
from kine2go_warp.dataset.trajectories import Trajectories
from kine2go_warp.dataset.writer import check_version
from kine2go_warp.errors import DatasetError


@dataclass(frozen=True)
class MotionData:
    """One motion of a dataset, in memory."""

    name: str
    attributes: dict[str, Any]
    time: NDArray[np.float64]
    """From the first kept row [s], shape [num_rows]."""
    trajectories: Trajectories


def motion_names(path: Path) -> list[str]:
    """Return the names of the motions in a dataset.

    Raises:
        DatasetError: there is no dataset at ``path``.
    """
    if (path.resolve().parent / "zarr.json").is_file():
        raise DatasetError(f"{path}: a part of a store; name the dataset itself, {path.resolve().parent}")
    if not (path / "zarr.json").is_file():
        raise DatasetError(f"{path}: {absence(path)}; make a dataset with 'kine2go gather' or 'kine2go run'")
    check_version(path)
    return sorted(folder.parent.name for folder in path.glob("*/zarr.json"))


def absence(path: Path) -> str:
    """Return why there is no dataset at a path."""
    if path.is_file():
        return "no dataset here, a dataset is a folder and this is a file"
    if not path.exists():
        return "no dataset here, nor anything else"
    return "no dataset here, the folder holds no zarr.json"


def read_motion(path: Path, motion: str) -> MotionData:
    """Read a whole motion.

    Raises:
        DatasetError: the dataset or the motion is missing, or an array cannot be read.
    """
    names = motion_names(path)
    if motion not in names:
        raise DatasetError(f"{path}: holds no motion '{motion}'; it has: {', '.join(names) or 'none'}")
    try:
        group = zarr.open_group(path / motion, mode="r")
    except Exception as error:  # noqa: BLE001 - damaged metadata raises errors of many kinds
        raise DatasetError(f"{path}/{motion}: cannot be read ({error.__class__.__name__})") from None

    def read(name: str) -> NDArray:
        try:
            return np.asarray(group[name][...])  # pyright: ignore[reportArgumentType, reportIndexIssue]
        except Exception as error:  # noqa: BLE001 - codecs and stores raise errors of many kinds
            raise DatasetError(f"{path}/{motion}/{name}: cannot be read ({error.__class__.__name__})") from None

    trajectories = Trajectories(
        rows={array.name: read(array.name) for array in ROW_ARRAYS},
        draws={array.name: read(array.name) for array in TRAJECTORY_ARRAYS},
        groups={
            name: {array.name: read(f"{name}/{array.name}") for array in arrays} for name, arrays in SUB_GROUPS.items()
        },
    )
    return MotionData(motion, dict(group.attrs), read("time"), trajectories)
