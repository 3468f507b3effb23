"""What a dataset holds: every array with its dimensions, unit and meaning."""

from dataclasses import dataclass

from kine2go_warp.robots import RobotSpec

FORMAT_VERSION = "0.1"

# Names and maxima of kernels.rewards, said again so that readers of a dataset need no Warp.
REWARD_TERMS = ("joint_position", "joint_velocity", "foot_position", "root_pose", "root_velocity")
MAXIMUM_REWARDS = (1.0, 1.0, 1.0, 2.0, 2.0)

FRAMES_NOTE = (
    "World frame: z up, metres, seconds, radians. Quaternions are (w, x, y, z), unit and continuous in time. Row t "
    "holds the state that the policy saw at control step t and the action that it chose from it, so action[t] leads "
    "from state[t] to state[t+1]. Forces and torques of row t are those of the physics substep that ended in state[t]; "
    "reward[t] is what action[t] earned."
)


@dataclass(frozen=True)
class ArraySpec:
    """One array of a motion group."""

    name: str
    dims: tuple[str, ...]
    unit: str
    description: str
    dtype: str = "float32"


_FRAME = ("trajectory", "frame")

ROW_ARRAYS = (
    ArraySpec("root_position", (*_FRAME, "axis"), "m", "base link origin, world frame"),
    ArraySpec("root_orientation", (*_FRAME, "quaternion"), "1", "base link in the world, (w, x, y, z)"),
    ArraySpec("root_linear_velocity", (*_FRAME, "axis"), "m/s", "velocity of the base link origin, world frame"),
    ArraySpec("root_angular_velocity", (*_FRAME, "axis"), "rad/s", "angular velocity of the base, world frame"),
    ArraySpec("joint_position", (*_FRAME, "joint"), "rad", "relative to the parent link"),
    ArraySpec("joint_velocity", (*_FRAME, "joint"), "rad/s", "relative to the parent link"),
    ArraySpec("link_position", (*_FRAME, "link", "axis"), "m", "joint centres and feet, world frame"),
    ArraySpec("link_linear_velocity", (*_FRAME, "link", "axis"), "m/s", "of joint centres and feet, world frame"),
    ArraySpec("foot_contact_force", (*_FRAME, "foot", "axis"), "N", "force of the floor on the foot, world frame"),
    ArraySpec("action", (*_FRAME, "joint"), "1", "sampled command: (joint_target - default pose) / action scale"),
    ArraySpec("action_mean", (*_FRAME, "joint"), "1", "the same for the mean of the policy's distribution"),
    ArraySpec("joint_target", (*_FRAME, "joint"), "rad", "commanded joint position"),
    ArraySpec("joint_torque", (*_FRAME, "joint"), "N m", "torque applied in the last physics substep"),
    ArraySpec("phase", _FRAME, "1", "place in the reference cycle, in [0, 1)"),
    ArraySpec("cycle", _FRAME, "1", "whole reference cycles passed"),
    ArraySpec("reference_root_position", (*_FRAME, "axis"), "m", "reference at the row's instant, world frame"),
    ArraySpec("reference_root_orientation", (*_FRAME, "quaternion"), "1", "reference at the row's instant, wxyz"),
    ArraySpec("reference_joint_position", (*_FRAME, "joint"), "rad", "reference at the row's instant"),
    ArraySpec("reference_foot_position", (*_FRAME, "foot", "axis"), "m", "reference at the row's instant, world"),
    ArraySpec("reward", (*_FRAME, "term"), "1", "weighted terms of the tracking reward"),
)
"""Arrays with one entry a row, padded with NaN where a trajectory is shorter."""

TRAJECTORY_ARRAYS = (
    ArraySpec("length", ("trajectory",), "1", "valid rows", "int32"),
    ArraySpec("heading", ("trajectory",), "rad", "turn of the whole reference about the z axis"),
    ArraySpec("seed", ("trajectory",), "1", "seed that the rollout was drawn from", "uint32"),
    ArraySpec("start_phase", ("trajectory",), "1", "place in the cycle where the rollout began, before the trim"),
    ArraySpec("noise", ("trajectory",), "1", "noise on the actions, in standard deviations of the policy"),
)
"""How each rollout was drawn."""

QUALITY_ARRAYS = (
    ArraySpec("joint_rmse", ("trajectory",), "rad", "root mean square joint position error"),
    ArraySpec("root_error", ("trajectory",), "m", "mean distance of the root from its reference"),
    ArraySpec("root_angle", ("trajectory",), "rad", "mean angle of the root from its reference"),
    ArraySpec("foot_error", ("trajectory",), "m", "mean distance of the feet from their references"),
)
"""How well each rollout tracked, computed from its rows."""


def coordinates(spec: RobotSpec) -> dict[str, tuple[str, ...]]:
    """Return the labels along each labelled dimension."""
    return {
        "axis": ("x", "y", "z"),
        "quaternion": ("w", "x", "y", "z"),
        "joint": spec.joint_names,
        "link": spec.link_names,
        "foot": tuple(name.removesuffix("_foot") for name in spec.foot_links),
        "term": REWARD_TERMS,
    }
