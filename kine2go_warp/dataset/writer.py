"""Writing motions into a store, each whole or not at all."""

import json
import os
import platform
import shutil
import warnings
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray
from zarr.codecs import ZstdCodec

from kine2go_warp import __version__
from kine2go_warp.dataset.quality import tracking_quality
from kine2go_warp.dataset.schema import (
    FORMAT_VERSION,
    FRAMES_NOTE,
    QUALITY_ARRAYS,
    ROW_ARRAYS,
    TRAJECTORY_ARRAYS,
    ArraySpec,
    coordinates,
)
from kine2go_warp.dataset.trajectories import Trajectories
from kine2go_warp.errors import DatasetError
from kine2go_warp.files import atomic_file, flush_folder
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
    kill.
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
        self._discard_leftovers()

    def motions(self) -> list[str]:
        """Return the names of the motions in the store."""
        return sorted(folder.parent.name for folder in self.path.glob("*/zarr.json"))

    def attributes(self, motion: str) -> dict[str, Any]:
        """Return the attributes of a motion, empty if it is not there or damaged."""
        if not (self.path / motion / "zarr.json").is_file():
            return {}
        try:
            return dict(zarr.open_group(self.path / motion, mode="r").attrs)
        except Exception:  # noqa: BLE001 - damaged metadata raises errors of many kinds
            return {}

    def write(
        self, motion: str, trajectories: Trajectories, simulation: SimulationAttributes, attributes: Mapping[str, Any]
    ) -> None:
        """Add a motion, replacing an older one of that name.

        Args:
            motion: Its name.
            trajectories: Its data.
            simulation: How it was simulated, which must be the same for all motions of a dataset.
            attributes: Attributes of the motion.

        Raises:
            DatasetError: the dataset holds motions that were simulated otherwise.
        """
        self.check(motion, simulation)
        staging = self._staging(motion)
        shutil.rmtree(staging, ignore_errors=True)
        frame_duration = 1.0 / simulation.control_frequency
        try:
            self._write_group(staging, trajectories.padded(), frame_duration, attributes)
            flush_folder(staging)
            self._write_root(simulation)
            self._put_in_place(staging, self.path / motion)
            self._write_index()
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
        shared = {name: robot[name] for name in ("robot_model_sha256", "action_scale", "default_joint_position")}
        for name, value in {**shared, **asdict(simulation)}.items():
            if known.get(name) != value:
                raise DatasetError(
                    f"{self.path}: holds motions with {name} {known.get(name)}, and {motion} has {value}; "
                    "choose another dataset"
                )

    def _write_root(self, simulation: SimulationAttributes) -> None:
        """Write the root's attributes, without the index of all arrays, which would not know of a change."""
        attributes = {**robot_attributes(self.spec), **asdict(simulation)}
        if not self.path.exists():
            staging = self._staging("root")
            shutil.rmtree(staging, ignore_errors=True)
            zarr.open_group(staging, mode="w", zarr_format=3).attrs.update(attributes)
            staging.rename(self.path)
        zarr.open_group(self.path, mode="a", zarr_format=3, use_consolidated=False).attrs.update(attributes)
        metadata = json.loads((self.path / "zarr.json").read_text())
        metadata.pop("consolidated_metadata", None)
        with atomic_file(self.path / "zarr.json") as temporary:
            temporary.write_text(json.dumps(metadata, indent=2))

    def _write_index(self) -> None:
        """Write the index of all arrays into the root's metadata, the last thing to change."""
        consolidate(self.path)

    def _staging(self, motion: str) -> Path:
        """Return where a motion is written before it is put in place, on the same file system as the store."""
        return self.path.with_name(f".tmp-{self.path.name}-{motion}-{platform.node()}-{os.getpid()}")

    def _put_in_place(self, staging: Path, final: Path) -> None:
        """Rename a finished motion into the store."""
        if final.exists():
            old = self._staging(f"old-{final.name}")
            final.rename(old)
            staging.rename(final)
            shutil.rmtree(old)
        else:
            staging.rename(final)

    def _discard_leftovers(self) -> None:
        """Remove what killed processes of this machine left beside the store."""
        for leftover in self.path.parent.glob(f".tmp-{self.path.name}-*-{platform.node()}-*"):
            pid = leftover.name.rpartition("-")[2]
            if pid.isdigit() and not is_running(int(pid)):
                shutil.rmtree(leftover, ignore_errors=True)

    def _write_group(
        self, folder: Path, trajectories: Trajectories, frame_duration: float, attributes: Mapping[str, Any]
    ) -> None:
        """Write one motion as a group of its own."""
        group = zarr.open_group(folder, mode="w", zarr_format=3)
        group.attrs.update({**attributes, "coordinates": "time"})
        for name, labels in coordinates(self.spec).items():
            write_labels(group, name, labels)
        time = np.arange(trajectories.num_rows) * frame_duration
        write_array(group, ArraySpec("time", ("frame",), "s", "from the first kept row", "float64"), time)
        write_array(
            group,
            ArraySpec("trajectory", ("trajectory",), "1", "number of the trajectory", "int32"),
            np.arange(trajectories.num_trajectories),
        )
        for array in ROW_ARRAYS:
            write_array(group, array, trajectories.rows[array.name])
        for array in TRAJECTORY_ARRAYS:
            write_array(group, array, trajectories.draws[array.name])
        quality = group.create_group("quality")
        figures = tracking_quality(trajectories.rows)
        for array in QUALITY_ARRAYS:
            write_array(quality, array, figures[array.name])
        consolidate(folder)


def is_running(pid: int) -> bool:
    """Return whether a process of this machine exists."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def write_array(group: zarr.Group, array: ArraySpec, values: NDArray) -> None:
    """Write one array: a chunk a trajectory, one shard in all, lossless."""
    values = np.asarray(values, dtype=array.dtype)
    chunks = (1, *values.shape[1:]) if values.ndim > 1 else values.shape
    target = group.create_array(
        array.name,
        shape=values.shape,
        dtype=values.dtype,
        chunks=chunks,
        shards=values.shape if values.ndim > 1 else None,
        compressors=ZstdCodec(level=3),
        fill_value=np.nan if values.dtype.kind == "f" else 0,
        dimension_names=array.dims,
        attributes={"units": array.unit, "description": array.description},
    )
    target[...] = values


def consolidate(folder: Path) -> None:
    """Put the metadata of all arrays below a group into its own, so that readers need one file and do not warn."""
    with warnings.catch_warnings():
        # Not in the Zarr 3 core specification yet; readers that do not know it read the arrays' own metadata.
        warnings.simplefilter("ignore")
        zarr.consolidate_metadata(str(folder), zarr_format=3)


def write_labels(group: zarr.Group, name: str, labels: tuple[str, ...]) -> None:
    """Write the labels of a dimension as its coordinate."""
    with warnings.catch_warnings():
        # Fixed-length text is not in the Zarr 3 core specification yet, but every reader we know takes it.
        warnings.simplefilter("ignore")
        target = group.create_array(
            name,
            shape=(len(labels),),
            dtype=f"<U{max(map(len, labels))}",
            chunks=(len(labels),),
            dimension_names=(name,),
        )
        target[...] = np.array(labels)


def robot_attributes(spec: RobotSpec) -> dict[str, Any]:
    """Return what a consumer must know of format and robot."""
    return {
        "format": "kine2go",
        "format_version": FORMAT_VERSION,
        "software_version": __version__,
        "software_revision": revision(),
        "conventions": FRAMES_NOTE,
        "robot": spec.name,
        "robot_model_sha256": spec.model_hash,
        "joint_names": list(spec.joint_names),
        "foot_names": list(spec.foot_links),
        "link_names": list(spec.link_names),
        "default_joint_position": list(spec.default_joint_position),
        "action_scale": spec.action_scale,
        "sdk_motor_order": list(spec.sdk_motor_order),
    }


def check_version(path: Path) -> None:
    """Check that a store is one of ours.

    Raises:
        DatasetError: it is not, or its format version is another.
    """
    try:
        attributes = dict(zarr.open_group(path, mode="r").attrs)
    except Exception as error:  # noqa: BLE001 - damaged metadata raises errors of many kinds
        raise DatasetError(f"{path}: not a Zarr store that can be read ({error.__class__.__name__})") from None
    if attributes.get("format") != "kine2go":
        raise DatasetError(f"{path}: a Zarr store, but not a dataset of kine2go")
    if attributes.get("format_version") != FORMAT_VERSION:
        raise DatasetError(
            f"{path}: dataset format {attributes.get('format_version')}; this version reads and writes "
            f"{FORMAT_VERSION}: gather the data again, or use the version that wrote it"
        )
