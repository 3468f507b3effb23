"""The metrics by which gathering filters rollouts, from their rows: for the filter and for the checks."""

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
        "leg_contact": np.nanmean(rows["leg_contact"], axis=1),
        "joint_limit": metrics.joint_limit_share(rows["joint_position"], spec.joint_lower, spec.joint_upper),
        "torque_saturation": metrics.torque_saturation(rows["torque_at_limit"]),
        "action_saturation": metrics.action_saturation(rows["joint_target"], spec.joint_lower, spec.joint_upper),
        "foot_slip": metrics.foot_slip(contact_velocities(spec, rows), rows["foot_contact_force"]),
        "joint_jerk": metrics.joint_jerk(rows["joint_velocity"], frame_duration),
        "joint_speed": np.nanmax(np.abs(rows["joint_velocity"]) / np.array(spec.joint_speed), axis=(1, 2)),
        "leg_overlap": np.maximum(-np.nanmin(rows["leg_distance"], axis=1), 0.0),
    }
