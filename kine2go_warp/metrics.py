"""Metrics of rollouts: what each one is called and means, and how it is computed, with NumPy alone.

``METRICS`` is the table of names, units, meanings and of the limits that the filter of gathering sets. The functions of
tracking errors take the rows of a dataset by name. All others take arrays of shape [num_trajectories, num_rows, ...] in
which rows beyond a trajectory's end are NaN, and return one value for each trajectory, shape [num_trajectories]; NaN
where a trajectory has nothing to measure. Positions and velocities are in the world frame unless a name says otherwise,
quaternions are (w, x, y, z).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.rotations import conjugate, multiply, rotate, rotation_angle, rotation_vector

Array = NDArray[np.float64]
Rows = Mapping[str, NDArray[Any]]
"""Row arrays of a dataset by name, each of shape [..., num_rows, *row]."""

GRAVITY = 9.81
"""[m/s^2]"""
CONTACT_FORCE = 1.0
"""A foot that the floor pushes harder than this is in contact [N]: below 1 % of the robot's weight, and above what is
left of a contact that opens. Slip, recordings and their viewer share it."""
HARD_PUSH = 0.2
"""A push that adds more than this to the velocity of the base throws the robot off its reference [m/s]."""
SATURATION = 0.999
"""A torque above this share of the motor's largest counts as saturated."""
LIMIT_MARGIN = 0.01
"""A joint this close to one of its limits counts as being at it [rad]."""
LEAST_SPEED = 0.05
"""Below this mean speed there is no transport to speak of [m/s]."""
FOOT_LINKS = slice(12, 16)
"""Where the feet are among the links."""


@dataclass(frozen=True, kw_only=True)
class Metric:
    """What a metric is, and by which limit the filter of gathering rejects a rollout."""

    name: str
    unit: str
    description: str
    better: Literal["lower", "higher"] = "lower"
    is_share: bool = False
    """Whether it is the share of rollouts to which something happened."""
    setting: str = ""
    """Setting of gathering that limits it, empty if none does."""
    reason: str = ""
    """Why a rollout beyond the limit is rejected."""
    label: str = ""
    """Short name beside its limit."""

    @property
    def heading(self) -> str:
        """Its name in words."""
        return self.name.replace("_", " ").replace("rmse", "RMSE").replace("emd", "EMD")


def _limited(name: str, unit: str, description: str, setting: str, reason: str, label: str) -> Metric:
    return Metric(name=name, unit=unit, description=description, setting=setting, reason=reason, label=label)


FILTER_METRICS = (
    _limited("largest_root_error", "m", "largest distance of the root from its reference",
             "max_distance", "distance", "root distance"),
    _limited("largest_root_angle", "rad", "largest angle of the root from its reference",
             "max_angle", "rotation", "root angle"),
    _limited("joint_rmse", "rad", "root mean square joint position error",
             "max_joint_rmse", "joint_error", "joint RMSE"),
    _limited("leg_contact", "1",
             "share of rows in which a thigh or calf touches the ground, but for where the reference does",
             "max_leg_contact", "leg_contact", "leg contact"),
    _limited("joint_limit", "1", f"share of joint positions within {LIMIT_MARGIN:g} rad of a limit, or beyond it",
             "max_joint_limit", "joint_limit", "joint limits"),
    _limited("torque_saturation", "1", "share of the torques of all physics substeps at the motors' limit",
             "max_torque_saturation", "torque_saturation", "torque limits"),
    _limited("action_saturation", "1", "share of commanded joint targets beyond the joints' limits",
             "max_action_saturation", "action_saturation", "action limits"),
    _limited("foot_slip", "m/s",
             "mean horizontal speed of the lowest point of a foot while the floor pushes it with more than "
             f"{CONTACT_FORCE:g} N", "max_foot_slip", "foot_slip", "foot slip"),
    _limited("joint_jerk", "rad/s^3", "mean size of the joint jerks", "max_joint_jerk", "jerk", "joint jerk"),
    _limited("joint_speed", "1", "largest joint speed as a share of the motor's largest",
             "max_joint_speed", "joint_speed", "joint speed"),
    _limited("leg_overlap", "m", "greatest depth of a leg in another one, the trunk or the head",
             "max_leg_overlap", "leg_overlap", "leg overlap"),
)  # fmt: skip
"""Those that the filter of gathering limits; the first one that is exceeded is the reason."""

TRACKING_METRICS = (
    Metric(name="root_error", unit="m", description="mean distance of the root from its reference"),
    Metric(name="root_angle", unit="rad", description="mean angle of the root from its reference"),
    Metric(name="foot_error", unit="m",
           description="mean distance of the four feet from their references in the world (MPJPE of the feet)"),
)  # fmt: skip
"""Those of ``tracking_quality`` that have no limit."""

METRICS = {metric.name: metric for metric in (*FILTER_METRICS, *TRACKING_METRICS)}
"""Metrics that a dataset stores for each trajectory, by name; ``scores.registry`` has those that are scored."""


def root_error(rows: Rows) -> NDArray[Any]:
    """Return the distance of the root from its reference [m], shape [..., num_rows]."""
    return np.linalg.norm(rows["root_position"] - rows["reference_root_position"], axis=-1)


def root_angle(rows: Rows) -> Array:
    """Return the angle of the root from its reference [rad], shape [..., num_rows]."""
    return rotation_angle(rows["root_orientation"], rows["reference_root_orientation"])


def joint_error(rows: Rows) -> Array:
    """Return the joint position errors [rad], shape [..., num_rows, num_joints]."""
    return (rows["joint_position"] - rows["reference_joint_position"]).astype(np.float64)


def joint_rmse(rows: Rows) -> Array:
    """Return the root mean square over the joints of each row's position errors [rad], shape [..., num_rows]."""
    return np.sqrt(np.mean(joint_error(rows) ** 2, axis=-1))


def foot_error(rows: Rows) -> NDArray[Any]:
    """Return the distance of each foot from its reference [m], shape [..., num_rows, 4]."""
    return np.linalg.norm(rows["link_position"][..., FOOT_LINKS, :] - rows["reference_foot_position"], axis=-1)


def settled_rows(push: NDArray[Any], recovery: NDArray[np.bool_], num_rows: float) -> NDArray[np.bool_]:
    """Return in which rows a robot should be back at its reference, shape [num_trajectories, num_rows].

    Where it never has the time, all rows are returned.

    Args:
        push: Velocity that a push adds right after each row [m/s], shape [num_trajectories, num_rows, 3].
        recovery: Which trajectories begin off their reference, shape [num_trajectories].
        num_rows: Rows that it has to come back, from such a beginning and after each hard push on.
    """
    is_hard = np.linalg.norm(push, axis=-1) > HARD_PUSH
    begins = np.concatenate([np.asarray(recovery, bool)[:, None], is_hard[:, :-1]], axis=1)
    row = np.arange(begins.shape[1])
    last = np.maximum.accumulate(np.where(begins, row, -np.inf), axis=1)
    settled = row - last >= num_rows
    return settled | ~(settled & np.isfinite(push[..., 0])).any(axis=1, keepdims=True)


def tracking_quality(rows: Rows) -> dict[str, NDArray[Any]]:
    """Return the mean tracking errors by the names in ``METRICS``, each of shape [num_trajectories].

    Padding (NaN) does not count.
    """
    return {
        "joint_rmse": np.sqrt(np.nanmean(joint_error(rows) ** 2, axis=(1, 2))),
        "root_error": np.nanmean(root_error(rows), axis=1),
        "root_angle": np.nanmean(root_angle(rows), axis=1),
        "foot_error": np.nanmean(foot_error(rows), axis=(1, 2)),
    }


def mean_per_trajectory(values: NDArray[Any]) -> Array:
    """Return the mean over all axes but the first, without NaN."""
    values = np.asarray(values, np.float64).reshape(len(values), -1)
    there = ~np.isnan(values)
    with np.errstate(invalid="ignore"):
        return np.sum(values, axis=1, where=there) / there.sum(axis=1)


def share_per_trajectory(happens: NDArray[np.bool_], values: NDArray[Any]) -> Array:
    """Return in which share of the entries of ``values`` that are not NaN something happens."""
    return mean_per_trajectory(np.where(np.isnan(values), np.nan, happens))


def mean_distance(a: NDArray[Any], b: NDArray[Any]) -> Array:
    """Return the mean length of ``a - b``, vectors along the last axis."""
    return mean_per_trajectory(np.linalg.norm(np.asarray(a, np.float64) - b, axis=-1))


def mean_square(a: NDArray[Any], b: NDArray[Any]) -> Array:
    """Return the mean square of ``a - b`` over rows and components."""
    return mean_per_trajectory((np.asarray(a, np.float64) - b) ** 2)


def root_mean_square(a: NDArray[Any], b: NDArray[Any]) -> Array:
    """Return the root of the mean square of ``a - b`` over rows and components."""
    return np.sqrt(mean_square(a, b))


def rotation_error(orientation: NDArray[Any], reference: NDArray[Any]) -> Array:
    """Return the mean angle between orientations [rad]."""
    turn = rotation_vector(multiply(orientation, conjugate(reference)))
    return mean_per_trajectory(np.linalg.norm(turn, axis=-1))


def in_base_frame(points: NDArray[Any], root_position: NDArray[Any], root_orientation: NDArray[Any]) -> Array:
    """Return points as seen from the base [m], shape [num_trajectories, num_rows, num_points, 3]."""
    offset = np.asarray(points, np.float64) - root_position[..., None, :]
    return rotate(conjugate(root_orientation)[..., None, :], offset)


def central_difference(values: NDArray[Any], frame_duration: float) -> Array:
    """Return rates of change at all rows but the first and last, shape [num_trajectories, num_rows - 2, ...]."""
    values = np.asarray(values, np.float64)
    return (values[:, 2:] - values[:, :-2]) / (2.0 * frame_duration)


def angular_velocity(orientation: NDArray[Any], frame_duration: float) -> Array:
    """Return angular velocities in the world frame [rad/s] at all rows but the first and last."""
    turn = multiply(orientation[:, 2:], conjugate(orientation[:, :-2]))
    return rotation_vector(turn) / (2.0 * frame_duration)


def linear_velocity_error(velocity: NDArray[Any], reference_position: NDArray[Any], frame_duration: float) -> Array:
    """Return the mean length of the velocity error [m/s]; the reference's is a central difference."""
    return mean_distance(velocity[:, 1:-1], central_difference(reference_position, frame_duration))


def angular_velocity_error(velocity: NDArray[Any], reference_orientation: NDArray[Any], frame_duration: float) -> Array:
    """Return the mean length of the angular velocity error [rad/s]; the reference's is a central difference."""
    return mean_distance(velocity[:, 1:-1], angular_velocity(reference_orientation, frame_duration))


def joint_velocity_error(velocity: NDArray[Any], reference_position: NDArray[Any], frame_duration: float) -> Array:
    """Return the root mean square joint velocity error [rad/s]; the reference's is a central difference."""
    return root_mean_square(velocity[:, 1:-1], central_difference(reference_position, frame_duration))


def foot_slip(
    contact_velocity: NDArray[Any], foot_contact_force: NDArray[Any], contact_force: float = CONTACT_FORCE
) -> Array:
    """Return the mean horizontal speed of the feet over those rows and feet that are in contact [m/s].

    Args:
        contact_velocity: Of the points of the feet that touch the floor (``kinematics.contact_velocities``), so that a
            foot that rolls does not slip [m/s], shape [num_trajectories, num_rows, 4, 3].
        foot_contact_force: Force of the floor on each foot [N], same shape.
        contact_force: Least force of a contact [N].
    """
    speed = np.linalg.norm(contact_velocity[..., :2], axis=-1)
    contact = np.linalg.norm(foot_contact_force, axis=-1) > contact_force
    return mean_per_trajectory(np.where(contact, speed, np.nan))


def mechanical_power(joint_power: NDArray[Any]) -> Array:
    """Return the mean over rows of the sum over joints of the size of each joint's power [W]."""
    return mean_per_trajectory(np.sum(np.abs(np.asarray(joint_power, np.float64)), axis=-1))


def mean_speed(root_position: NDArray[Any], frame_duration: float) -> Array:
    """Return the length of the root's path in the plane by its duration [m/s]."""
    steps = np.linalg.norm(np.diff(np.asarray(root_position, np.float64)[..., :2], axis=1), axis=-1)
    return mean_per_trajectory(steps) / frame_duration


def cost_of_transport(power: Array, speed: Array, mass: float) -> Array:
    """Return power by weight and speed [1], NaN for a robot that hardly moves; all but ``mass`` [num_trajectories]."""
    moves = speed > LEAST_SPEED
    return np.where(moves, power / (mass * GRAVITY * np.where(moves, speed, 1.0)), np.nan)


def torque_saturation(torque_at_limit: NDArray[Any]) -> Array:
    """Return the mean over rows and joints of the share of physics substeps with the motor at its limit."""
    return mean_per_trajectory(torque_at_limit)


def joint_limit_share(
    joint_position: NDArray[Any],
    lower: NDArray[Any] | tuple[float, ...],
    upper: NDArray[Any] | tuple[float, ...],
    margin: float = LIMIT_MARGIN,
) -> Array:
    """Return the share of joint positions at their limits [rad], shape [num_joints], or beyond them."""
    position = np.asarray(joint_position, np.float64)
    reached = (position <= np.asarray(lower) + margin) | (position >= np.asarray(upper) - margin)
    return share_per_trajectory(reached, position)


def action_saturation(
    command: NDArray[Any], lower: NDArray[Any] | tuple[float, ...], upper: NDArray[Any] | tuple[float, ...]
) -> Array:
    """Return the share of commands beyond what can be followed.

    Commands are joint targets [rad] with the joints' limits, or actions with the bounds that the controller clips to.
    """
    command = np.asarray(command, np.float64)
    return share_per_trajectory((command < np.asarray(lower)) | (command > np.asarray(upper)), command)


def mean_change(values: NDArray[Any]) -> Array:
    """Return the mean size of the change from one row to the next, over rows and components."""
    return mean_per_trajectory(np.abs(np.diff(np.asarray(values, np.float64), axis=1)))


def joint_acceleration(joint_velocity: NDArray[Any], frame_duration: float) -> Array:
    """Return the mean size of the change of joint velocity from row to row [rad/s^2]."""
    return mean_change(joint_velocity) / frame_duration


def joint_jerk(joint_velocity: NDArray[Any], frame_duration: float) -> Array:
    """Return the mean size of the second difference of joint velocity [rad/s^3]."""
    second = np.diff(np.asarray(joint_velocity, np.float64), n=2, axis=1)
    return mean_per_trajectory(np.abs(second)) / frame_duration**2
