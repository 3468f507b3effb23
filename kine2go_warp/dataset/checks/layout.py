"""What the schema says that a motion's group holds."""

from collections.abc import Sequence
from dataclasses import dataclass

from kine2go_warp.dataset.schema import (
    OPTIONAL_ROW_ARRAYS,
    ROW_ARRAYS,
    SUB_GROUPS,
    TRAJECTORY_ARRAYS,
    ArraySpec,
    coordinates,
)
from kine2go_warp.robots import RobotSpec

COORDINATES = (
    ArraySpec("time", ("frame",), "s", "from the first kept row", "float64"),
    ArraySpec("trajectory", ("trajectory",), "1", "number of the trajectory", "int32"),
)
"""Coordinates that are numbers."""


@dataclass(frozen=True)
class Layout:
    """The arrays of a motion by name, those of sub-groups as ``group/name``."""

    arrays: dict[str, ArraySpec]
    labels: dict[str, tuple[str, ...]]
    """Coordinates that are names, by the dimension that they label."""

    @property
    def sizes(self) -> dict[str, int]:
        """Sizes of the dimensions that the robot decides."""
        num_joints = len(self.labels["joint"])
        sizes = {name: len(labels) for name, labels in self.labels.items()}
        return {**sizes, "coordinate": 7 + num_joints, "velocity": 6 + num_joints}

    @classmethod
    def of(cls, spec: RobotSpec, reward_terms: Sequence[str], observed: Sequence[str] = ()) -> "Layout":
        """Return the layout for a robot, some reward terms and, where they are stored, columns of observations."""
        optional = OPTIONAL_ROW_ARRAYS if observed else ()
        arrays = {array.name: array for array in (*COORDINATES, *ROW_ARRAYS, *optional, *TRAJECTORY_ARRAYS)}
        for group, members in SUB_GROUPS.items():
            arrays.update({f"{group}/{array.name}": array for array in members})
        return cls(arrays, coordinates(spec, reward_terms, observed))
