"""One motion of a dataset, of which only what is asked for is read."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray

from kine2go_warp.dataset.location import described, is_remote, open_group, root_attributes
from kine2go_warp.dataset.schema import REASON, REJECTED, ROW_ARRAYS, SUB_GROUPS, TRAJECTORY_ARRAYS, ArraySpec
from kine2go_warp.dataset.store import robot_in, unpacked
from kine2go_warp.dataset.trajectories import Trajectories
from kine2go_warp.errors import DatasetError
from kine2go_warp.robots import RobotSpec

BLOCK = 32
"""Trajectories that are read at once: a call to Zarr takes milliseconds however little it reads."""


@dataclass(frozen=True)
class TrajectoryReference:
    """Where one trajectory of a dataset is, and what is known of it as a whole."""

    motion: str
    """Name of its motion."""
    index: int
    """Its place among the trajectories of the motion."""
    length: int
    """Valid rows."""
    values: Mapping[str, Any] = field(repr=False, compare=False)
    """What is stored once a trajectory, such as ``noise`` or ``quality/joint_rmse``; read when it is asked for."""


@dataclass(frozen=True)
class Trajectory(TrajectoryReference):
    """One trajectory in memory."""

    arrays: dict[str, NDArray[Any]] = field(repr=False, compare=False)
    """Arrays by name, each of shape [length, ...]: no padding."""


@dataclass(frozen=True)
class MotionData:
    """Trajectories of one motion in memory, padded to the same number of rows."""

    name: str
    attributes: dict[str, Any]
    time: NDArray[np.float64]
    """From the first kept row [s], shape [num_rows]."""
    trajectories: Trajectories
    indices: NDArray[np.int64]
    """Index of each trajectory in the store, shape [num_trajectories]."""

    @property
    def frame_duration(self) -> float:
        """Time from one row to the next [s].

        Raises:
            DatasetError: the motion has fewer than two rows.
        """
        if len(self.time) < 2:
            raise DatasetError(f"{self.name}: holds fewer than two rows; see 'kine2go dataset check'")
        return float(self.time[1] - self.time[0])


class TrajectoryValues(Mapping[str, Any]):
    """What a motion stores once a trajectory, for one of its trajectories."""

    def __init__(self, motion: "Motion", index: int) -> None:
        self._motion, self._index = motion, index

    def __getitem__(self, name: str) -> Any:
        return self._motion.values(name)[self._index]

    def __contains__(self, name: object) -> bool:
        return name in self._motion.trajectory_arrays

    def get(self, name: str, default: Any = None) -> Any:
        """Return what is stored under a name, or the default if nothing is."""
        return self._motion.values(name)[self._index] if name in self else default

    def __iter__(self) -> Iterator[str]:
        return iter(self._motion.trajectory_arrays)

    def __len__(self) -> int:
        return len(self._motion.trajectory_arrays)


class Motion:
    """One motion of a dataset.

    With ``include_rejected`` the rollouts that gathering rejected follow the accepted ones, where they are stored, and
    ``reason`` is an array of trajectories: why each was rejected, an empty text for those that were not.
    """

    def __init__(self, path: Path, name: str, include_rejected: bool = False) -> None:
        """Open a motion; its arrays stay on the disk.

        Args:
            path: Folder of the dataset.
            name: The motion.
            include_rejected: Whether rejected rollouts are part of it, too.

        Raises:
            DatasetError: its metadata cannot be read.
        """
        self.path, self.name = path, name
        self._values: dict[str, NDArray[Any]] = {}
        try:
            self._group = open_group(path / name)
            self.attributes = unpacked(self._group.attrs)
            self.arrays = {spec.name: spec for spec in _specs(self._group)}
            self._has_rejected = include_rejected and REJECTED in self._group
            if include_rejected:
                self.arrays[REASON.name] = replace(REASON, description=_REASON, dtype="str")
        except Exception as error:  # noqa: BLE001 - damaged metadata raises errors of many kinds
            raise DatasetError(f"{path}/{name}: cannot be read ({described(error)})") from None

    @property
    def robot(self) -> RobotSpec:
        """The robot.

        Raises:
            Kine2GoError: the robot is not available here.
        """
        return robot_in(root_attributes(self.path), self.path)

    @cached_property
    def row_arrays(self) -> dict[str, ArraySpec]:
        """Arrays with one entry a row, by name."""
        return {name: spec for name, spec in self.arrays.items() if spec.dims[:2] == ("trajectory", "frame")}

    @cached_property
    def trajectory_arrays(self) -> dict[str, ArraySpec]:
        """Arrays with one entry a trajectory, by name; those of sub-groups as ``quality/joint_rmse``."""
        return {
            name: spec
            for name, spec in self.arrays.items()
            if spec.dims[:1] == ("trajectory",) and name not in {"trajectory", *self.row_arrays}
        }

    @cached_property
    def lengths(self) -> NDArray[np.int32]:
        """Valid rows of each trajectory, shape [num_trajectories]."""
        return self.values("length")

    @cached_property
    def time(self) -> NDArray[np.float64]:
        """From the first kept row [s], shape [num_rows]."""
        return self.values("time")

    def labels(self, dimension: str) -> tuple[str, ...]:
        """Return the labels along a dimension, such as the names of the joints.

        Raises:
            DatasetError: the dimension has none.
        """
        if dimension not in self.arrays or self.arrays[dimension].dims != (dimension,):
            raise DatasetError(f"{self.path}/{self.name}: dimension '{dimension}' has no labels")
        return tuple(str(label) for label in self.values(dimension))

    def column_names(self, array: str) -> tuple[str, ...]:
        """Return the name of each number that a row array has in a row, in order, such as ``FL.x``.

        An array with one number a row has one column, with the name of the array.
        """
        names = [""]
        for dimension in self.spec(array).dims[2:]:
            names = [f"{name}.{label}" if name else label for name in names for label in self.labels(dimension)]
        return tuple(names) if names != [""] else (array,)

    def spec(self, name: str) -> ArraySpec:
        """Return dimensions, unit and meaning of a row array.

        Raises:
            DatasetError: there is no such array, or the schema's is missing.
        """
        if name not in self.row_arrays:
            if name in {array.name for array in ROW_ARRAYS}:
                raise self._missing(name)
            raise DatasetError(
                f"{self.path}/{self.name}: holds no row array '{name}'; it has: {', '.join(sorted(self.row_arrays))}"
            )
        return self.row_arrays[name]

    def values(self, name: str) -> NDArray[Any]:
        """Return an array that has no rows, such as ``noise``, shape [num_trajectories, ...]. It is read once.

        Raises:
            DatasetError: there is no such array, or it cannot be read.
        """
        if name not in self.arrays or name in self.row_arrays:
            known = ", ".join(sorted(self.trajectory_arrays))
            raise DatasetError(f"{self.path}/{self.name}: holds no array '{name}' of trajectories; it has: {known}")
        if name not in self._values:
            values = self._reasons() if name == REASON.name else self._read_whole(name)
            if values.size and _is_empty(name, values):
                raise self._missing(name)
            self._values[name] = values
        return self._values[name]

    def references(self) -> list[TrajectoryReference]:
        """Return a reference to every trajectory that is stored."""
        return [
            TrajectoryReference(self.name, index, int(length), TrajectoryValues(self, index))
            for index, length in enumerate(self.lengths)
        ]

    def read(self, references: Sequence[TrajectoryReference], arrays: Sequence[str] | None) -> Iterator[Trajectory]:
        """Read trajectories of this motion one after the other.

        Args:
            references: Which, in the order of their indices.
            arrays: Names of row arrays; by default all.

        Raises:
            DatasetError: there is no such array, one cannot be read, or data are missing.
        """
        if arrays is None:
            self._check_complete()
        names = [self.spec(name).name for name in (self.row_arrays if arrays is None else arrays)]
        for block in _blocks(references):
            first, last = block[0].index, block[-1].index
            rows = {name: self._read_rows(name, slice(first, last + 1)) for name in names}
            for reference in block:
                place, length = reference.index - first, reference.length
                cut = {name: values[place, :length] for name, values in rows.items()}
                yield Trajectory(self.name, reference.index, length, reference.values, cut)

    def load(self, references: Sequence[TrajectoryReference]) -> MotionData:
        """Read all arrays of some trajectories into memory.

        Args:
            references: Which, in the order of their indices. ``Dataset.load`` chooses those that no review rejected.

        Raises:
            DatasetError: an array cannot be read, or data are missing.
        """
        self._check_complete()
        indices = np.array([one.index for one in references], dtype=np.int64)
        draws: dict[str, NDArray[Any]] = {}
        groups: dict[str, dict[str, NDArray[Any]]] = {group: {} for group in SUB_GROUPS}
        for name in self.trajectory_arrays:
            group, _, member = name.rpartition("/")
            (groups.setdefault(group, {}) if group else draws)[member] = self.values(name)[indices]
        rows = {name: self._read_rows(name, slice(None))[indices] for name in self.row_arrays}
        return MotionData(self.name, self.attributes, self.time, Trajectories(rows, draws, groups), indices)

    def _read_rows(self, name: str, part: slice) -> NDArray[Any]:
        """Read a row array of some trajectories, whose valid rows must be there."""
        values, lengths = self._read_part(name, part), self.lengths[part]
        if values.dtype.kind != "f" or not values.size:
            return values
        flat = values.reshape(*values.shape[:2], -1)
        is_valid = np.arange(values.shape[1]) < lengths[:, None]
        # The fill value of what is missing is NaN. Whole rows are looked at only where their first number is NaN.
        suspect = is_valid & np.isnan(flat[:, :, 0])
        if suspect.any() and np.isnan(flat[suspect]).all(axis=-1).any():
            raise self._missing(name)
        return values

    def _check_complete(self) -> None:
        """Check that every array of the schema is there."""
        groups = [f"{group}/{array.name}" for group, arrays in SUB_GROUPS.items() for array in arrays]
        for name in (*(array.name for array in (*ROW_ARRAYS, *TRAJECTORY_ARRAYS)), *groups):
            if name not in self.arrays:
                raise self._missing(name)

    def _missing(self, name: str) -> DatasetError:
        return DatasetError(
            f"{self.path}/{self.name}/{name}: data are missing; see 'kine2go dataset check' and gather it again"
        )

    def _read_whole(self, name: str) -> NDArray[Any]:
        """Read an array, that of the rejected rollouts after it where it has an entry a trajectory."""
        values = self._read(name, ...)
        if not self._has_rejected or name not in self.trajectory_arrays:
            return values
        return np.concatenate([values, self._read(f"{REJECTED}/{name}", ...)])

    def _read_part(self, name: str, part: slice) -> NDArray[Any]:
        """Read some trajectories of a row array."""
        first, last, _ = part.indices(len(self.lengths))
        accepted = self.num_accepted
        if last <= accepted:
            return self._read(name, slice(first, last))
        others = self._read(f"{REJECTED}/{name}", slice(max(first - accepted, 0), last - accepted))
        return others if first >= accepted else np.concatenate([self._read(name, slice(first, accepted)), others])

    @cached_property
    def num_accepted(self) -> int:
        """Number of accepted rollouts; rejected ones have the indices from there on."""
        return int(self._group["length"].shape[0])  # pyright: ignore[reportAttributeAccessIssue]

    def _reasons(self) -> NDArray[np.str_]:
        """Return why each trajectory was rejected in gathering, an empty text for those that were accepted."""
        reasons = [""] * self.num_accepted
        if self._has_rejected:
            numbers = self._read(f"{REJECTED}/{REASON.name}", ...)
            meanings = str(self._group[f"{REJECTED}/{REASON.name}"].attrs["flag_meanings"]).split()
            reasons += [meanings[number] for number in numbers]
        return np.array(reasons, dtype=str)

    def _read(self, name: str, what: Any) -> NDArray[Any]:
        # The store's index names arrays whose folders have gone, and Zarr reads those as the fill value.
        if not is_remote(self.path) and not (self.path / self.name / name / "zarr.json").is_file():
            raise self._missing(name)
        try:
            return np.asarray(self._group[name][what])  # pyright: ignore[reportArgumentType, reportIndexIssue]
        except Exception as error:  # noqa: BLE001 - codecs and stores raise errors of many kinds
            raise DatasetError(f"{self.path}/{self.name}/{name}: cannot be read ({described(error)})") from None


_REASON = "why the rollout was rejected in gathering, an empty text if it was accepted"


def _is_empty(name: str, values: NDArray[Any]) -> bool:
    """Return whether an array that has no rows holds nothing but the fill value, as one does that lacks its data."""
    if values.dtype.kind in "UT":
        return name != REASON.name and bool((values == "").any())
    return bool(np.isnan(values).all()) if values.dtype.kind == "f" else name == "length" and not values.any()


def _specs(group: zarr.Group) -> Iterator[ArraySpec]:
    """Yield what the store says of each array of a motion, in the order of their names."""
    for name, member in sorted(group.members(max_depth=None)):
        if isinstance(member, zarr.Array) and name.split("/")[0] != REJECTED:
            dims = tuple(str(dimension) for dimension in getattr(member.metadata, "dimension_names", None) or ())
            attributes = member.attrs
            unit, description = str(attributes.get("units", "1")), str(attributes.get("description", ""))
            yield ArraySpec(name, dims, unit, description, str(member.dtype))


def _blocks(references: Sequence[TrajectoryReference]) -> Iterator[list[TrajectoryReference]]:
    """Split references, sorted by index, where the next one is ``BLOCK`` or more places from the block's first."""
    block: list[TrajectoryReference] = []
    for reference in references:
        if block and reference.index >= block[0].index + BLOCK:
            yield block
            block = []
        block.append(reference)
    if block:
        yield block
