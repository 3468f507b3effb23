"""Reads what can be read of a motion that may be damaged."""

import contextlib
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray

from kine2go_warp.dataset.checks.block import Block, Settings, is_rows
from kine2go_warp.dataset.checks.layout import Layout
from kine2go_warp.dataset.checks.records import Finding
from kine2go_warp.dataset.location import described
from kine2go_warp.dataset.schema import observation_labels, reward_labels
from kine2go_warp.dataset.store import unpacked
from kine2go_warp.robots import RobotSpec

BLOCK = 32
"""Trajectories that are in memory at once."""

READABLE = "readable"
"""Name of the check that findings of this file belong to."""


@dataclass
class StoredMotion:
    """The arrays of a motion as the store has them, opened one by one so that a damaged one spoils no other."""

    name: str
    attributes: dict[str, Any]
    arrays: dict[str, zarr.Array[Any]]
    """By name, those of sub-groups as ``group/name``; those that cannot be opened are not there."""
    groups: set[str]
    """Names of the sub-groups."""
    unreadable: dict[str, str] = field(default_factory=dict)
    """Arrays that cannot be opened or read, and why."""

    @classmethod
    def open(cls, folder: Path) -> "StoredMotion":
        """Open a motion.

        Raises:
            Exception: its own metadata cannot be read; of many kinds.
        """
        group = zarr.open_group(folder, mode="r", use_consolidated=False)
        motion = cls(folder.name, unpacked(group.attrs), {}, set())
        motion._open_members(folder, "")
        return motion

    def read(self, name: str, part: slice = slice(None)) -> NDArray[Any] | None:
        """Return an array or some of its trajectories, None if it is not there or cannot be read."""
        if name not in self.arrays or name in self.unreadable:
            return None
        try:
            return np.asarray(self.arrays[name][part])
        except Exception as error:  # noqa: BLE001 - codecs and stores raise errors of many kinds
            self.unreadable[name] = f"cannot be read ({described(error)})"
            return None

    def findings(self) -> list[Finding]:
        """Return what could not be read."""
        return [Finding(READABLE, self.name, why, name) for name, why in sorted(self.unreadable.items())]

    def _open_members(self, folder: Path, prefix: str) -> None:
        """Open the arrays of a group and of its sub-groups."""
        for path in sorted(folder.iterdir()):
            if not path.is_dir():
                continue
            name = prefix + path.name
            try:
                member = quietly(lambda path=path: zarr.open(path, mode="r", zarr_format=3, use_consolidated=False))
                if not isinstance(member.metadata.attributes, dict):
                    raise TypeError("attributes are no dictionary")
            except Exception as error:  # noqa: BLE001 - damaged metadata raises errors of many kinds
                self.unreadable[name] = f"its metadata cannot be read ({described(error)})"
                continue
            if isinstance(member, zarr.Array):
                self.arrays[name] = member
                if member.size and member.dtype.kind == "f" and np.isnan(member.fill_value) and not has_chunks(path):
                    self.unreadable[name] = "its data are missing"
            else:
                self.groups.add(name)
                self._open_members(path, f"{name}/")


def quietly(function: Callable[[], Any]) -> Any:
    """Call a function without the warnings about what is not in the Zarr 3 core specification yet."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return function()


def has_chunks(folder: Path) -> bool:
    """Return whether an array has any data; absent chunks would silently read as the fill value."""
    return any(path.is_file() for path in (folder / "c").rglob("*"))


def blocks(motion: StoredMotion, root: dict[str, Any], spec: RobotSpec) -> Iterator[Block]:
    """Yield a motion's trajectories in double precision, a few at a time.

    Arrays that cannot be read, or whose dimensions are not those of the schema, are left out.

    Args:
        motion: The motion.
        root: Attributes of the dataset.
        spec: The robot.
    """
    settings = Settings.read(root, motion.attributes)
    names = usable(motion, spec)
    if not any(is_rows(name, motion.arrays[name]) for name in names):
        return
    total = motion.arrays[names[0]].shape[0]
    for numbers in np.array_split(np.arange(total), max(1, -(-total // BLOCK))):
        if not len(numbers):
            return
        part = slice(int(numbers[0]), int(numbers[-1]) + 1)
        values = {name: motion.read(name, part) for name in names}
        stored = {name: one.astype(np.float64) for name, one in values.items() if one is not None}
        if any(is_rows(name, one) for name, one in stored.items()):
            yield Block(part.start, stored, settings, spec)


def usable(motion: StoredMotion, spec: RobotSpec) -> list[str]:
    """Return the arrays whose shape fits the schema and the majority of the others."""
    layout = motion_layout(motion, spec)
    sizes = layout.sizes
    for dimension in ("trajectory", "frame", "slot"):
        with contextlib.suppress(ValueError):
            sizes[dimension] = common_size(motion, layout, dimension)
    return [
        name
        for name, array in layout.arrays.items()
        if array.dims[0] == "trajectory"
        and name in motion.arrays
        and motion.arrays[name].shape == tuple(sizes.get(dimension) for dimension in array.dims)
        and motion.arrays[name].dtype.kind in "fiu"
    ]


def motion_layout(motion: StoredMotion, spec: RobotSpec) -> Layout:
    """Return what a motion should hold; its attributes name the reward terms."""
    terms = motion.arrays.get("term")
    rewards = reward_labels(motion.attributes, terms.shape[0] if terms is not None and terms.ndim else 0)
    return Layout.of(spec, rewards, observation_labels(motion.attributes))


def common_size(motion: StoredMotion, layout: Layout, dimension: str) -> int:
    """Return the size that most arrays have along a dimension.

    Raises:
        ValueError: no array has it.
    """
    sizes = [
        motion.arrays[name].shape[array.dims.index(dimension)]
        for name, array in layout.arrays.items()
        if dimension in array.dims and name in motion.arrays and motion.arrays[name].ndim == len(array.dims)
    ]
    return max(sizes, key=sizes.count)
