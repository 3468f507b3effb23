"""The metrics by which gathering filters rollouts, from their rows: for the filter and for the checks."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp import metrics
from kine2go_warp.metrics import Rows
from kine2go_warp.robots import RobotSpec
from kine2go_warp.robots.kinematics import contact_velocities

QUALITY_NEEDS = (
    "root_position", "root_orientation", "root_angular_velocity", "joint_position", "joint_velocity", "joint_target",
    "link_position", "link_linear_velocity", "foot_contact_force", "leg_contact", "leg_distance", "torque_at_limit",
    "reference_root_position", "reference_root_orientation", "reference_joint_position", "reference_foot_position",
    "reference_body_rests",
)  # fmt: skip
"""Row arrays that the metrics are computed from."""


def rollout_quality(rows: Rows, frame_duration: float, spec: RobotSpec) -> dict[str, NDArray[Any]]:
    """Return the metrics of rollouts but for the share of a limit, each of shape [num_trajectories].

    Args:
        rows: Rows as in the dataset, NaN beyond each trajectory's length.
        frame_duration: Time between two rows [s].
        spec: The robot.
    """
    return {
        **metrics.tracking_quality(rows),
        "largest_root_error": np.nanmax(metrics.root_error(rows), axis=1),
        "largest_root_angle": np.nanmax(metrics.root_angle(rows), axis=1),
        "leg_contact": np.nanmean(rows["leg_contact"] * (1.0 - rows["reference_body_rests"]), axis=1),
        "joint_limit": metrics.joint_limit_share(rows["joint_position"], spec.joint_lower, spec.joint_upper),
        "torque_saturation": metrics.torque_saturation(rows["torque_at_limit"]),
        "action_saturation": metrics.action_saturation(rows["joint_target"], spec.joint_lower, spec.joint_upper),
        "foot_slip": metrics.foot_slip(contact_velocities(spec, rows), rows["foot_contact_force"]),
        "joint_jerk": metrics.joint_jerk(rows["joint_velocity"], frame_duration),
        "joint_speed": np.nanmax(np.abs(rows["joint_velocity"]) / np.array(spec.joint_speed), axis=(1, 2)),
        "leg_overlap": np.maximum(-np.nanmin(rows["leg_distance"], axis=1), 0.0),
    }


def settled_quality(
    rows: Rows,
    quality: Mapping[str, NDArray[Any]],
    frame_duration: float,
    spec: RobotSpec,
    recovery: NDArray[np.bool_],
    recovery_time: float,
    limit_scale: float,
) -> dict[str, NDArray[Any]]:
    """Return the metrics that limits hold for: those of the rows in which a robot should be back at its reference.

    Legs in one another count in every row; distance and angle of the root as well, by a more generous limit.

    Args:
        rows: Rows as in the dataset.
        quality: Metrics of all rows.
        frame_duration: Time between two rows [s].
        spec: The robot.
        recovery: Which rollouts begin off their reference, shape [num_trajectories].
        recovery_time: That a robot has to come back [s].
        limit_scale: Distance and angle that are allowed meanwhile, as a multiple of their limits.
    """
    if not recovery_time:
        return dict(quality)
    settled = metrics.settled_rows(rows["push"], recovery, round(recovery_time / frame_duration))
    shape = settled.shape
    kept = {name: np.where(settled.reshape(*shape, *(1,) * (rows[name].ndim - 2)), rows[name], np.nan)
            for name in QUALITY_NEEDS}  # fmt: skip
    found = rollout_quality(kept, frame_duration, spec)
    for name in ("largest_root_error", "largest_root_angle"):
        found[name] = np.fmax(found[name], quality[name] / limit_scale)
    return {**found, "leg_overlap": quality["leg_overlap"]}
