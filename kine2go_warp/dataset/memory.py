"""Rows of many trajectories in one table in memory, from which windows are cut fast."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.access import Dataset, check_window
from kine2go_warp.dataset.motion import TrajectoryReference
from kine2go_warp.errors import DatasetError

OBSERVATION_ARRAYS = (
    "root_orientation",
    "root_linear_velocity",
    "root_angular_velocity",
    "joint_position",
    "joint_velocity",
    "action",
)
"""What imitation usually learns from: the state that the robot could know, and the action."""


@dataclass(frozen=True)
class Columns:
    """Where an array lies in the table."""

    start: int
    stop: int
    shape: tuple[int, ...]
    """Shape of the array in one row."""


@dataclass(frozen=True)
class PackedRows:
    """Trajectories one after the other in one contiguous table, so that a window is one piece of memory."""

    table: NDArray[np.float32]
    """All rows, shape [num_rows, num_columns]."""
    columns: dict[str, Columns]
    """Arrays by name, in the order of their columns."""
    references: tuple[TrajectoryReference, ...]
    first_rows: NDArray[np.int64]
    """Where each trajectory begins in the table, shape [num_trajectories]."""

    def array(self, name: str) -> NDArray[np.float32]:
        """Return one array of all rows, shape [num_rows, ...], a view.

        Raises:
            DatasetError: it was not loaded.
        """
        if name not in self.columns:
            raise DatasetError(f"array '{name}' was not loaded; loaded are: {', '.join(self.columns)}")
        place = self.columns[name]
        return self.table[:, place.start : place.stop].reshape(len(self.table), *place.shape)

    def window_starts(self, rows: int, stride: int = 1) -> NDArray[np.int64]:
        """Return the first row in the table of every window that lies in one trajectory, shape [num_windows].

        Args:
            rows: Length of a window.
            stride: Rows from one window to the next in the same trajectory.

        Raises:
            DatasetError: a length or stride is below 1, or no trajectory is that long.
        """
        check_window(rows, stride)
        lengths = np.array([reference.length for reference in self.references], dtype=np.int64)
        counts = np.maximum((lengths - rows) // stride + 1, 0)
        if not counts.any():
            longest = lengths.max(initial=0)
            raise DatasetError(f"no trajectory has {rows} rows, as a window should; the longest has {longest}")
        window = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        return np.repeat(self.first_rows, counts) + stride * window


def load_rows(
    dataset: Dataset,
    arrays: Sequence[str] = OBSERVATION_ARRAYS,
    on_trajectory: Callable[[int, int], None] | None = None,
) -> PackedRows:
    """Read arrays of a dataset into memory.

    Args:
        dataset: The dataset, or a selection of it.
        arrays: Names of row arrays.
        on_trajectory: Called with the trajectories read and their total.

    Raises:
        DatasetError: there is nothing to load, no such array, or one cannot be read.
    """
    references = dataset.references
    if not references or not arrays:
        raise DatasetError(f"{dataset.path}: nothing to load; the selection holds no trajectories or no arrays")
    columns = _columns(dataset, references[0].motion, arrays)
    width = max(place.stop for place in columns.values())
    table = np.empty((dataset.num_rows, width), dtype=np.float32)
    first_rows, loaded, row = [], [], 0
    for one in dataset.trajectories(arrays=tuple(columns)):
        first_rows.append(row)
        for name, place in columns.items():
            table[row : row + one.length, place.start : place.stop] = one.arrays[name].reshape(one.length, -1)
        row += one.length
        loaded.append(TrajectoryReference(one.motion, one.index, one.length, one.values))
        if on_trajectory is not None:
            on_trajectory(len(loaded), len(references))
    return PackedRows(table, columns, tuple(loaded), np.array(first_rows, dtype=np.int64))


def _columns(dataset: Dataset, motion: str, arrays: Sequence[str]) -> dict[str, Columns]:
    """Lay arrays side by side."""
    columns: dict[str, Columns] = {}
    start = 0
    for name in arrays:
        spec = dataset.motion(motion).spec(name)
        shape = tuple(len(dataset.motion(motion).labels(dimension)) for dimension in spec.dims[2:])
        columns[name] = Columns(start, start + math.prod(shape), shape)
        start += math.prod(shape)
    return columns
