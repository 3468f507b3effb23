"""Opening a dataset: by trajectory, by window, or a selection of it. Needs NumPy and Zarr only."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from kine2go_warp.dataset.location import located, root_attributes
from kine2go_warp.dataset.motion import Motion, MotionData, Trajectory, TrajectoryReference
from kine2go_warp.dataset.selection import by_motion, rejected_trajectories, validation_indices
from kine2go_warp.dataset.store import motion_names, robot_in
from kine2go_warp.errors import DatasetError
from kine2go_warp.robots import RobotSpec


@dataclass(frozen=True)
class Window:
    """Neighbouring rows of one trajectory."""

    motion: str
    index: int
    """Place of the trajectory in its motion."""
    start: int
    """First row of the window in the trajectory."""
    arrays: dict[str, NDArray[Any]] = field(repr=False, compare=False)
    """Arrays by name, each of shape [rows, ...]."""


def open_dataset(path: Path | str, include_rejected: bool = False) -> "Dataset":
    """Open a dataset; nothing but names and attributes is read.

    Every loader, export, score and report reads through this, so it is the one place that decides which trajectories
    count: all accepted rollouts with at least one row that no review rejected.

    Args:
        path: Folder of the store, or its address on a server: ``https://``, ``s3://``, ``hf://``, whatever fsspec reads
            (extra ``remote``).
        include_rejected: Whether trajectories that were rejected in a review are part of it, too, and after those of
            each motion the rollouts that gathering rejected, where they are stored; ``values["reason"]`` says why.

    Raises:
        DatasetError: there is no dataset at ``path``, it has another format version, or the server cannot be reached or
            sends whole files only.
    """
    path = located(path)
    names = motion_names(path)
    attributes = root_attributes(path)
    return Dataset(path, attributes, {name: _Opener(path, name, include_rejected) for name in names})


class _Opener:
    """Opens a motion, and reads what reviews said of it, when that is first needed."""

    def __init__(self, path: Path, name: str, include_rejected: bool) -> None:
        self._path, self._name, self._include_rejected = path, name, include_rejected

    @cached_property
    def motion(self) -> Motion:
        """The motion."""
        return Motion(self._path, self._name, self._include_rejected)

    @cached_property
    def left_out(self) -> frozenset[int]:
        """Indices of the trajectories that are left out because a review rejected them."""
        return frozenset() if self._include_rejected else rejected_trajectories(self.motion)

    @cached_property
    def references(self) -> tuple[TrajectoryReference, ...]:
        """The trajectories that are part of the dataset."""
        return tuple(one for one in self.motion.references() if one.length > 0 and one.index not in self.left_out)


class Dataset:
    """Trajectories of a dataset, or a selection of them."""

    def __init__(
        self,
        path: Path,
        attributes: dict[str, Any],
        openers: dict[str, _Opener],
        chosen: tuple[TrajectoryReference, ...] | None = None,
    ) -> None:
        """Use :func:`open_dataset`.

        Args:
            path: Folder of the store.
            attributes: Of the store's root.
            openers: Its motions by name.
            chosen: The trajectories; by default all of those motions, but for those that a review rejected.
        """
        self.path, self.attributes = path, attributes
        self._openers, self._chosen = openers, chosen

    @property
    def motions(self) -> list[str]:
        """Names of the motions."""
        return list(self._openers)

    @property
    def rate(self) -> float:
        """Rows a second [Hz]."""
        return float(self.attributes["control_frequency"])

    @property
    def robot(self) -> RobotSpec:
        """The robot.

        Raises:
            Kine2GoError: the robot is not available here.
        """
        return robot_in(self.attributes, self.path)

    @cached_property
    def references(self) -> tuple[TrajectoryReference, ...]:
        """The trajectories, motion by motion; their arrays are not read."""
        if self._chosen is not None:
            return self._chosen
        return tuple(one for opener in self._openers.values() for one in opener.references)

    @property
    def num_rows(self) -> int:
        """Valid rows of all trajectories."""
        return sum(reference.length for reference in self.references)

    def motion(self, name: str) -> Motion:
        """Return a motion.

        Raises:
            DatasetError: the dataset does not hold it, or it is damaged.
        """
        return self._opener(name).motion

    def left_out(self, name: str) -> frozenset[int]:
        """Return the indices of a motion's trajectories that are left out because a review rejected them.

        Raises:
            DatasetError: the dataset does not hold the motion, or the file of reviews cannot be read.
        """
        return self._opener(name).left_out

    def load(self, name: str) -> MotionData:
        """Read the trajectories of one motion into memory, padded with NaN to the same number of rows.

        Raises:
            DatasetError: the dataset does not hold the motion, an array or the file of reviews cannot be read, or data
                are missing.
        """
        motion = self.motion(name)
        return motion.load([one for one in self.references if one.motion == name])

    def chosen(self, motions: Sequence[str] = ()) -> list[str]:
        """Return the names that are given, each once and checked, or those of all motions if none is given.

        Raises:
            DatasetError: the dataset is empty, or lacks one of them.
        """
        if not self.motions:
            raise DatasetError(f"{self.path}: holds no motions; add some with 'kine2go dataset gather'")
        return [self.motion(name).name for name in dict.fromkeys(motions)] or self.motions

    def select(
        self,
        motions: Sequence[str] | None = None,
        where: Callable[[TrajectoryReference], bool] | None = None,
    ) -> "Dataset":
        """Return a part of this dataset.

        Args:
            motions: Names of motions; by default all.
            where: Keeps the trajectories for which it is true, for example
                ``lambda trajectory: trajectory.values["noise"] == 0``.

        Raises:
            DatasetError: there is no such motion.
        """
        names = self.motions if motions is None else [self.motion(name).name for name in motions]
        part = Dataset(self.path, self.attributes, {name: self._openers[name] for name in names})
        if self._chosen is None and where is None:
            return part
        known = part.references if self._chosen is None else [one for one in self._chosen if one.motion in names]
        return part._with(one for one in known if where is None or where(one))

    def split(self, validation: float, seed: int = 0) -> tuple["Dataset", "Dataset"]:
        """Return a part for training and one for validation, whole trajectories each.

        The same seed always gives the same split, and a trajectory stays on its side whatever else is selected.

        Args:
            validation: Share of each motion's trajectories, between 0 and 1.
            seed: Another seed gives another split.

        Raises:
            DatasetError: the share is not between 0 and 1.
        """
        if not 0.0 <= validation <= 1.0:
            raise DatasetError(f"the share of trajectories for validation must be between 0 and 1, not {validation}")
        held_out = {name: validation_indices(self.motion(name), validation, seed) for name in self.motions}
        sides: tuple[list[TrajectoryReference], list[TrajectoryReference]] = ([], [])
        for one in self.references:
            sides[one.index in held_out[one.motion]].append(one)
        return self._with(sides[0]), self._with(sides[1])

    def trajectories(
        self, motions: Sequence[str] | None = None, arrays: Sequence[str] | None = None
    ) -> Iterator[Trajectory]:
        """Iterate over trajectories; a few are read at once.

        Args:
            motions: Names of motions; by default all.
            arrays: Names of row arrays; by default all.

        Raises:
            DatasetError: there is no such motion or array, or one cannot be read.
        """
        part = self if motions is None else self.select(motions)
        for name, references in by_motion(part.references).items():
            yield from self.motion(name).read(references, arrays)

    def windows(
        self, rows: int, stride: int, motions: Sequence[str] | None = None, arrays: Sequence[str] | None = None
    ) -> Iterator[Window]:
        """Iterate over windows of neighbouring rows in order; none crosses the end of a trajectory.

        Args:
            rows: Length of a window.
            stride: Rows from the start of one window to that of the next in the same trajectory.
            motions: Names of motions; by default all.
            arrays: Names of row arrays; by default all.

        Raises:
            DatasetError: a length or stride is below 1; otherwise as for :meth:`trajectories`.
        """
        check_window(rows, stride)
        for one in self.trajectories(motions, arrays):
            for start in range(0, one.length - rows + 1, stride):
                cut = {name: values[start : start + rows] for name, values in one.arrays.items()}
                yield Window(one.motion, one.index, start, cut)

    def _opener(self, name: str) -> _Opener:
        if name not in self._openers:
            raise DatasetError(f"{self.path}: holds no motion '{name}'; it has: {', '.join(self._openers) or 'none'}")
        return self._openers[name]

    def _with(self, chosen: Iterator[TrajectoryReference] | Sequence[TrajectoryReference]) -> "Dataset":
        """Return these motions with other trajectories."""
        return Dataset(self.path, self.attributes, self._openers, tuple(chosen))


def check_window(rows: int, stride: int) -> None:
    """Check the size of windows.

    Raises:
        DatasetError: a length or stride is below 1.
    """
    if rows < 1 or stride < 1:
        raise DatasetError(f"windows need at least 1 row and a stride of at least 1, not {rows} and {stride}")
