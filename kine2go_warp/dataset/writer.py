"""Writing motions into a store, each whole or not at all."""

import shutil
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray

from kine2go_warp import __version__
from kine2go_warp.dataset.root_index import consolidate, write_index
from kine2go_warp.dataset.schema import (
    ACTION_RULE,
    FORMAT_VERSION,
    FRAMES_NOTE,
    OPTIONAL_ROW_ARRAYS,
    REASON,
    REJECTED,
    ROW_ARRAYS,
    SUB_GROUPS,
    TRAJECTORY_ARRAYS,
    ArraySpec,
    coordinates,
    observation_labels,
    reward_labels,
)
from kine2go_warp.dataset.shards import COMPRESSOR, SHARD_TRAJECTORIES, RowArray, write_row_arrays
from kine2go_warp.dataset.staging import StagingArea
from kine2go_warp.dataset.store import check_version, motion_folders, packed, unpacked
from kine2go_warp.dataset.trajectories import Rollouts, padded
from kine2go_warp.errors import DatasetError
from kine2go_warp.files import flush_folder, link_or_copy, same_bytes
from kine2go_warp.revision import revision
from kine2go_warp.robots import RobotSpec


@dataclass(frozen=True)
class SimulationAttributes:
    """What is common to all motions of a dataset, kept in its root."""

    control_frequency: float
    """[Hz]"""
    physics_substeps: int
    """Physics steps in one control step."""
    stiffness: float
    """Of the motors [N m/rad]."""
    damping: float
    """Of the motors [N m s/rad]."""


class DatasetWriter:
    """A dataset to which motions are added one by one.

    A motion is written beside the store and renamed into it, so that the store holds whole motions only, also after a
    kill. What a killed process of this machine has left beside the store, the next writer puts back or removes.
    """

    def __init__(self, path: Path, spec: RobotSpec) -> None:
        """Open a store, or prepare to create it with its first motion.

        Args:
            path: Folder of the store.
            spec: The robot.

        Raises:
            DatasetError: something else lies at ``path``, or a dataset of another format version.
        """
        self.path, self.spec = path, spec
        if path.exists() and not (path / "zarr.json").is_file():
            raise DatasetError(f"{path}: exists and is not a dataset; choose another name")
        if path.exists():
            check_version(path)
        self._area = StagingArea(path)
        others_write = self._area.recover()
        self._counts: dict[str, dict[str, int]] = {}
        if self.motions() and not others_write and "motions" not in self._area.root_metadata().get("attributes", {}):
            self._write_index()

    def motions(self) -> list[str]:
        """Return the names of the motions in the store."""
        return motion_folders(self.path)

    def attributes(self, motion: str) -> dict[str, Any]:
        """Return the attributes of a motion, empty if it is not there or damaged."""
        if not (self.path / motion / "zarr.json").is_file():
            return {}
        try:
            return unpacked(zarr.open_group(self.path / motion, mode="r").attrs)
        except Exception:  # noqa: BLE001 - damaged metadata raises errors of many kinds
            return {}

    def write(
        self,
        motion: str,
        trajectories: Rollouts,
        simulation: SimulationAttributes,
        attributes: Mapping[str, Any],
        rejected: "RejectedRollouts | None" = None,
    ) -> None:
        """Add a motion, replacing an older one of that name. A few rollouts are in memory at a time.

        Args:
            motion: Its name.
            trajectories: Its data.
            simulation: How it was simulated, which must be the same for all motions of a dataset.
            attributes: Attributes of the motion.
            rejected: Rollouts that were rejected, if they are to be kept.

        Raises:
            DatasetError: the dataset holds motions that were simulated otherwise.
        """
        self.check(motion, simulation)
        staging = self._area.folder("new", motion)
        shutil.rmtree(staging, ignore_errors=True)
        frame_duration = 1.0 / simulation.control_frequency
        whole = {**robot_attributes(self.spec), **asdict(simulation), **attributes}
        try:
            self._write_group(staging, trajectories, frame_duration, whole, rejected)
            flush_folder(staging)
            self._commit(motion, simulation)
        finally:
            shutil.rmtree(staging, ignore_errors=True)

    def adopt(self, source: Path, motion: str, replaceable: Sequence[str] = ()) -> None:
        """Take a motion over from another store, sharing its files where the file system can.

        Args:
            source: The other store, on which nobody writes any more.
            motion: The motion; one of that name that is not the same is replaced.
            replaceable: Motions that may be removed if they were simulated otherwise than this one.

        Raises:
            DatasetError: the dataset holds other motions that were simulated otherwise.
        """
        if same_bytes(source / motion / "zarr.json", self.path / motion / "zarr.json"):
            return
        root = zarr.open_group(source, mode="r").attrs
        simulation = SimulationAttributes(**{field.name: root[field.name] for field in fields(SimulationAttributes)})  # pyright: ignore[reportArgumentType]
        others = set(self.motions()) - {motion}
        try:
            self.check(motion, simulation)
        except DatasetError:
            if not others <= set(replaceable):
                raise
            self._write_root(simulation)
            for other in sorted(others):
                self._area.remove(other)
        staging = self._area.folder("new", motion)
        shutil.rmtree(staging, ignore_errors=True)
        try:
            shutil.copytree(source / motion, staging, copy_function=link_or_copy)
            flush_folder(staging)
            self._commit(motion, simulation)
        finally:
            shutil.rmtree(staging, ignore_errors=True)

    def check(self, motion: str, simulation: SimulationAttributes) -> None:
        """Check that a motion was simulated like those that are there, with the same robot.

        Raises:
            DatasetError: it was not.
        """
        if not set(self.motions()) - {motion}:
            return
        known = zarr.open_group(self.path, mode="r", use_consolidated=False).attrs
        robot = robot_attributes(self.spec)
        names = ("robot", "robot_model_sha256", "action_scale", "default_joint_position")
        shared = {name: robot[name] for name in names}
        for name, value in {**shared, **asdict(simulation)}.items():
            if known.get(name) != value:
                raise DatasetError(
                    f"{self.path}: holds motions with {name} {known.get(name)}, and {motion} has {value}; "
                    "choose another dataset"
                )

    def _commit(self, motion: str, simulation: SimulationAttributes) -> None:
        """Put a motion that is written beside the store into it.

        Raises:
            DatasetError: another process has added motions that were simulated otherwise.
        """
        with self._area.alone():
            self.check(motion, simulation)
            self._write_root(simulation)
            self._area.put_in_place(motion)
            self._counts.pop(motion, None)
            self._write_index()

    def _write_root(self, simulation: SimulationAttributes) -> None:
        """Write the root's attributes, without the lists of motions and arrays, which would not know of a change."""
        metadata = self._area.root_metadata() or {"zarr_format": 3, "node_type": "group", "attributes": {}}
        metadata["attributes"].update({**robot_attributes(self.spec), **asdict(simulation)})
        self._counts = metadata["attributes"].pop("motions", {})
        metadata.pop("consolidated_metadata", None)
        self._area.replace_root_metadata(metadata)

    def _write_index(self) -> None:
        """Write the lists of motions and arrays into the root's metadata, the last thing to change."""
        write_index(self._area, self.motions(), self._counts)

    def spool(self, motion: str) -> Path:
        """Return where rollouts of a motion may lie until they are written. What is left behind is removed later."""
        return self._area.folder("spool", motion)

    def _write_group(
        self,
        folder: Path,
        trajectories: Rollouts,
        frame_duration: float,
        attributes: Mapping[str, Any],
        rejected: "RejectedRollouts | None",
    ) -> None:
        """Write one motion as a group of its own."""
        group = zarr.open_group(folder, mode="w", zarr_format=3)
        group.attrs.update({**packed(attributes), "coordinates": "time"})
        terms = reward_labels(attributes, trajectories.read_rows("reward", 0, 1).shape[-1])
        for name, labels in coordinates(self.spec, terms, observation_labels(attributes)).items():
            write_labels(group, name, labels)
        time = np.arange(trajectories.num_rows) * frame_duration
        write_array(group, ArraySpec("time", ("frame",), "s", "from the first kept row", "float64"), time)
        write_array(
            group,
            ArraySpec("trajectory", ("trajectory",), "1", "number of the trajectory", "int32"),
            np.arange(trajectories.num_trajectories),
        )
        write_rollouts(group, folder, trajectories)
        for name, arrays in SUB_GROUPS.items():
            write_members(group.create_group(name), arrays, trajectories.groups[name])
        if rejected is not None and rejected.rollouts.num_trajectories:
            write_rejected(group.create_group(REJECTED), folder / REJECTED, rejected)
        consolidate(folder)


@dataclass(frozen=True)
class RejectedRollouts:
    """Rollouts that were rejected."""

    rollouts: Rollouts
    reasons: Sequence[str]
    """Why, one text a rollout."""


def write_rollouts(group: zarr.Group, folder: Path, rollouts: Rollouts, dimension: str = "trajectory") -> None:
    """Write rows and draws of rollouts into a group, whose files are in ``folder``."""
    count, lengths = rollouts.num_trajectories, rollouts.draws["length"]
    optional = (array for array in OPTIONAL_ROW_ARRAYS if array.name in rollouts.names)
    arrays = []
    for array in (*ROW_ARRAYS, *optional):
        shape = (count, *rollouts.read_rows(array.name, 0, 1).shape[1:])

        def read(first: int, last: int, name: str = array.name) -> NDArray[Any]:
            return padded(rollouts.read_rows(name, first, last), lengths[first:last])

        target = create_array(group, along(array, dimension), shape, np.dtype(array.dtype))
        arrays.append(RowArray(target, folder / array.name, read))
    write_row_arrays(arrays)
    write_members(group, (along(array, dimension) for array in TRAJECTORY_ARRAYS), rollouts.draws)


def write_members(group: zarr.Group, arrays: Iterable[ArraySpec], values: Mapping[str, NDArray[Any]]) -> None:
    """Write arrays that have one entry a trajectory."""
    for array in arrays:
        write_array(group, array, values[array.name])


def write_rejected(group: zarr.Group, folder: Path, rejected: RejectedRollouts) -> None:
    """Write rollouts that were rejected, with the reasons, along a dimension of their own."""
    write_rollouts(group, folder, rejected.rollouts, REJECTED)
    for name, arrays in SUB_GROUPS.items():
        members = tuple(along(array, REJECTED) for array in arrays)
        write_members(group.create_group(name), members, rejected.rollouts.groups[name])
    meanings = sorted(set(rejected.reasons))
    write_array(group, along(REASON, REJECTED), np.array([meanings.index(reason) for reason in rejected.reasons]))
    group["reason"].attrs.update({"flag_values": list(range(len(meanings))), "flag_meanings": " ".join(meanings)})


def along(array: ArraySpec, dimension: str) -> ArraySpec:
    """Return an array with another name for the dimension of trajectories."""
    return replace(array, dims=(dimension, *array.dims[1:]))


def write_array(group: zarr.Group, array: ArraySpec, values: NDArray[Any]) -> None:
    """Write one array at once."""
    values = np.asarray(values, dtype=array.dtype)
    create_array(group, array, values.shape, values.dtype)[...] = values


def create_array(group: zarr.Group, array: ArraySpec, shape: tuple[int, ...], dtype: np.dtype) -> zarr.Array[Any]:
    """Create an array: a chunk a trajectory, few shards, lossless, with a checksum against damage on the disk."""
    is_rows = array.dims[1:2] == ("frame",)
    return group.create_array(
        array.name,
        shape=shape,
        dtype=dtype,
        chunks=(1, *shape[1:]) if is_rows else shape,
        shards=(min(shape[0], SHARD_TRAJECTORIES), *shape[1:]) if is_rows else None,
        compressors=COMPRESSOR,
        fill_value=np.nan if dtype.kind == "f" else 0,
        dimension_names=array.dims,
        attributes={"units": array.unit, "description": array.description},
        # Values that are all NaN, such as what no rollout reached, are not to be taken for lost ones.
        config={"write_empty_chunks": True},
    )


def write_labels(group: zarr.Group, name: str, labels: tuple[str, ...]) -> None:
    """Write the labels of a dimension as its coordinate: texts of any length, which readers in other languages know."""
    with warnings.catch_warnings():
        # Some versions of zarr say that such texts are not in the core specification of Zarr 3.
        warnings.simplefilter("ignore")
        size = (len(labels),)
        target = group.create_array(name, shape=size, dtype="string", chunks=size, dimension_names=(name,))
        target[...] = np.array(labels, dtype=object)


def robot_attributes(spec: RobotSpec) -> dict[str, Any]:
    """Return what a consumer must know of format and robot."""
    return {
        "format": "kine2go",
        "format_version": FORMAT_VERSION,
        "software_version": __version__,
        "software_revision": revision(),
        "conventions": FRAMES_NOTE,
        "action_rule": ACTION_RULE,
        "robot": spec.name,
        **({"robot_reference": spec.reference} if spec.defined_in else {}),
        "robot_model_sha256": spec.model_hash,
        "joint_names": list(spec.joint_names),
        "foot_names": list(spec.foot_links),
        "link_names": list(spec.link_names),
        "default_joint_position": list(spec.default_joint_position),
        "action_scale": spec.action_scale,
        "sdk_motor_order": list(spec.sdk_motor_order),
    }
