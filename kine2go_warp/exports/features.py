"""What exports hold of a row: the table of features, and the fields that they are put together to.

``STATE`` and ``GOAL`` are the learning views of all formats; whatever learns from an export gets the same numbers.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.motion import Motion, Trajectory
from kine2go_warp.rotations import conjugate, heading, multiply, rotate, rotation_vector, turn_planar

Rows = Mapping[str, NDArray[Any]]
"""Row arrays of one trajectory by name, each of shape [num_rows, ...]."""


@dataclass(frozen=True)
class Feature:
    """Some numbers of a row, computed from arrays of the dataset."""

    name: str
    dims: tuple[str, ...]
    """Dimensions of the dataset whose labels name its numbers; none for a single number."""
    unit: str
    frame: str
    """``world``; ``base``: turned as the base is; ``heading``: level, with its x axis where the base looks."""
    content: str
    arrays: tuple[str, ...]
    """Row arrays that it is computed from."""
    compute: Callable[[Rows], NDArray[Any]]
    """Returns it for some rows, shape [num_rows, ...]."""


def _in_base(array: str) -> Callable[[Rows], NDArray[Any]]:
    """Return what turns a vector from the world frame into that of the base."""
    return lambda rows: rotate(conjugate(rows["root_orientation"]), rows[array])


def _in_heading(array: str) -> Callable[[Rows], NDArray[Any]]:
    """Return what turns a vector from the world frame into that of the base's heading."""
    return lambda rows: turn_planar(rows[array], -heading(rows["root_orientation"]))


def _down(rows: Rows) -> NDArray[Any]:
    down = np.broadcast_to([0.0, 0.0, -1.0], rows["root_position"].shape)
    return rotate(conjugate(rows["root_orientation"]), down)


def _to_reference(rows: Rows) -> NDArray[Any]:
    apart = np.asarray(rows["reference_root_position"], np.float64) - rows["root_position"]
    return turn_planar(apart, -heading(rows["root_orientation"]))


def _turn_to_reference(rows: Rows) -> NDArray[Any]:
    return rotation_vector(multiply(conjugate(rows["root_orientation"]), rows["reference_root_orientation"]))


_AXIS, _JOINT = ("axis",), ("joint",)
_TURN = "root_orientation"

STATE = (
    Feature("height", (), "m", "world", "base link origin above the floor", ("root_position",),
            lambda rows: rows["root_position"][:, 2]),
    Feature("gravity", _AXIS, "1", "base", "direction of gravity", ("root_position", _TURN), _down),
    Feature("linear_velocity", _AXIS, "m/s", "base", "velocity of the base link origin",
            ("root_linear_velocity", _TURN), _in_base("root_linear_velocity")),
    Feature("angular_velocity", _AXIS, "rad/s", "base", "angular velocity of the base",
            ("root_angular_velocity", _TURN), _in_base("root_angular_velocity")),
    Feature("joint_position", _JOINT, "rad", "-", "joint positions", ("joint_position",),
            lambda rows: rows["joint_position"]),
    Feature("joint_velocity", _JOINT, "rad/s", "-", "joint velocities", ("joint_velocity",),
            lambda rows: rows["joint_velocity"]),
)  # fmt: skip
"""The state of the robot, the same wherever it is and wherever it looks."""

GOAL = (
    Feature("goal_position", _AXIS, "m", "heading", "from the base to the reference's",
            ("root_position", _TURN, "reference_root_position"), _to_reference),
    Feature("goal_rotation", _AXIS, "rad", "base", "rotation vector from the base to the reference's",
            (_TURN, "reference_root_orientation"), _turn_to_reference),
    Feature("goal_linear_velocity", _AXIS, "m/s", "heading", "velocity of the reference's base link origin",
            ("reference_root_linear_velocity", _TURN), _in_heading("reference_root_linear_velocity")),
    Feature("goal_angular_velocity", _AXIS, "rad/s", "heading", "angular velocity of the reference's base",
            ("reference_root_angular_velocity", _TURN), _in_heading("reference_root_angular_velocity")),
    Feature("goal_joint_position", _JOINT, "rad", "-", "joint positions of the reference",
            ("reference_joint_position",), lambda rows: rows["reference_joint_position"]),
    Feature("goal_joint_velocity", _JOINT, "rad/s", "-", "joint velocities of the reference",
            ("reference_joint_velocity",), lambda rows: rows["reference_joint_velocity"]),
)  # fmt: skip
"""Where the reference is at the same instant, as seen from the robot."""

REWARD = Feature("reward", (), "1", "-", "sum of the reward's terms, which the next state earned", ("reward",),
                 lambda rows: rows["reward"].sum(axis=1))  # fmt: skip


@dataclass(frozen=True)
class Field:
    """One field of an export: features side by side."""

    name: str
    """Its name in the export."""
    features: tuple[Feature, ...]
    columns: tuple[str, ...]
    """Name of each of its numbers in a row."""

    @property
    def arrays(self) -> tuple[str, ...]:
        """Row arrays of the dataset that it is computed from."""
        return tuple(dict.fromkeys(name for feature in self.features for name in feature.arrays))

    def values(self, rows: Rows) -> NDArray[np.float32]:
        """Return the field of some rows, shape [num_rows, num_columns]."""
        parts = [np.asarray(feature.compute(rows), np.float32) for feature in self.features]
        return np.ascontiguousarray(np.concatenate([part.reshape(len(part), -1) for part in parts], axis=1))


def joined(motion: Motion, features: Sequence[Feature], name: str) -> Field:
    """Return the field of several features, with columns such as ``gravity.x``.

    Args:
        motion: Any motion of the dataset, which has the labels.
        features: The features.
        name: Name of the field.
    """
    columns: list[str] = []
    for feature in features:
        labels = [""]
        for dimension in feature.dims:
            labels = [f"{label}.{one}" for label in labels for one in motion.labels(dimension)]
        columns += [f"{feature.name}{label}" for label in labels]
    return Field(name, tuple(features), tuple(columns))


def stored(motion: Motion, array: str, name: str | None = None) -> Field:
    """Return the field that holds one row array.

    Args:
        motion: Any motion of the dataset.
        array: Name of the array.
        name: Name of the field; by default that of the array.
    """
    spec = motion.spec(array)
    frame = "world" if "world" in spec.description else "-"
    feature = Feature(array, spec.dims[2:], spec.unit, frame, spec.description, (array,), lambda rows: rows[array])
    return Field(name or array, (feature,), motion.column_names(array))


@dataclass(frozen=True)
class Transitions:
    """A trajectory of T rows as T - 1 transitions between T observations; the last row is where it ended."""

    state: NDArray[np.float32]
    """``STATE``, shape [T, 34]."""
    goal: NDArray[np.float32]
    """``GOAL``, shape [T, 36]."""
    action: NDArray[np.float32]
    """Chosen in each row but the last, shape [T - 1, 12]."""
    reward: NDArray[np.float32]
    """Earned by the row after it, shape [T - 1]."""
    terminated: NDArray[np.bool_]
    """True in the last transition of a rollout that ended early, shape [T - 1]."""
    truncated: NDArray[np.bool_]
    """True in the last transition of any other, shape [T - 1]."""


TRANSITION_ARRAYS = tuple(
    dict.fromkeys(["action", *(array for feature in (*STATE, *GOAL, REWARD) for array in feature.arrays)])
)
"""Row arrays that transitions are computed from."""


def transitions(one: Trajectory) -> Transitions:
    """Return the transitions of a trajectory."""

    def side_by_side(features: Sequence[Feature]) -> NDArray[np.float32]:
        return Field("", tuple(features), ()).values(one.arrays)

    last = np.arange(one.length - 1) == one.length - 2
    terminated = bool(one.values["terminated"])
    action, reward = one.arrays["action"][:-1], side_by_side([REWARD])[:-1, 0]
    return Transitions(
        side_by_side(STATE), side_by_side(GOAL), action, reward, last & terminated, last & (not terminated)
    )
