"""Tracking rewards of the paper (appendix, "Reward structure"), each a pure function of a squared error."""

import warp as wp

from kine2go_warp.kernels.kinematics import LegGeometry, foot_position_b, foot_position_h
from kine2go_warp.kernels.reference import ReferenceState
from kine2go_warp.kernels.rotations import rotation_angle
from kine2go_warp.kernels.state import (
    RobotState,
    is_finite,
    joint_position,
    joint_velocity,
    leg_joint_position,
    root_angular_velocity_w,
    root_linear_velocity_w,
    root_orientation,
    root_position,
)

wp.set_module_options({"enable_backward": False})

REWARD_TERMS = ("joint_position", "joint_velocity", "foot_position", "root_pose", "root_velocity")
"""Names of the reward terms in the order of the kernel's output."""

MAXIMUM_REWARDS = (1.0, 1.0, 1.0, 2.0, 2.0)
"""Value of each unweighted term on the reference itself: the two root terms are sums of two exponentials."""


@wp.func
def joint_position_error(robot: RobotState, reference: ReferenceState, world: int) -> float:
    """Return the summed squared joint position error [rad^2]."""
    total = float(0.0)
    for joint in range(12):
        error = joint_position(robot, world, joint) - reference.joint_position[world, joint]
        total += error * error
    return total


@wp.func
def joint_velocity_error(robot: RobotState, reference: ReferenceState, world: int) -> float:
    """Return the summed squared joint velocity error [rad^2/s^2]."""
    total = float(0.0)
    for joint in range(12):
        error = joint_velocity(robot, world, joint) - reference.joint_velocity[world, joint]
        total += error * error
    return total


@wp.func
def foot_position_error(robot: RobotState, reference: ReferenceState, geometry: LegGeometry, world: int) -> float:
    """Return the summed squared error of the feet relative to the root, each in its own heading frame [m^2]."""
    total = float(0.0)
    rotation = root_orientation(robot, world)
    target_rotation = wp.transform_get_rotation(reference.root[world])
    for leg in range(4):
        q = leg_joint_position(robot, world, leg)
        foot = foot_position_h(rotation, foot_position_b(geometry, leg, q[0], q[1], q[2]))
        first = 3 * leg
        target_b = foot_position_b(
            geometry,
            leg,
            reference.joint_position[world, first],
            reference.joint_position[world, first + 1],
            reference.joint_position[world, first + 2],
        )
        total += wp.length_sq(foot - foot_position_h(target_rotation, target_b))
    return total


@wp.func
def root_pose_reward(robot: RobotState, reference: ReferenceState, world: int) -> float:
    """Return exp(-20 |position error|^2) + exp(-10 angle^2)."""
    root = reference.root[world]
    distance_sq = wp.length_sq(root_position(robot, world) - wp.transform_get_translation(root))
    angle = rotation_angle(root_orientation(robot, world), wp.transform_get_rotation(root))
    return wp.exp(-20.0 * distance_sq) + wp.exp(-10.0 * angle * angle)


@wp.func
def root_velocity_reward(robot: RobotState, reference: ReferenceState, world: int) -> float:
    """Return exp(-2 |linear velocity error|^2) + exp(-0.2 |angular velocity error|^2), both in the world frame."""
    linear_sq = wp.length_sq(root_linear_velocity_w(robot, world) - reference.linear_velocity[world])
    angular_sq = wp.length_sq(root_angular_velocity_w(robot, world) - reference.angular_velocity[world])
    return wp.exp(-2.0 * linear_sq) + wp.exp(-0.2 * angular_sq)


@wp.kernel
def tracking_rewards(
    robot: RobotState,
    reference: ReferenceState,
    geometry: LegGeometry,
    weights: wp.array(dtype=float),
    terms: wp.array2d(dtype=float),
    total: wp.array(dtype=float),
):
    """Write the weighted terms in the order of ``REWARD_TERMS``, shape [num_worlds, 5], and their sum.

    A world whose state is not finite earns nothing: one such number would spread through the learner to all worlds.
    """
    world = wp.tid()
    if not is_finite(robot, world):
        for term in range(5):
            terms[world, term] = 0.0
        total[world] = 0.0
        return
    terms[world, 0] = weights[0] * wp.exp(-5.0 * joint_position_error(robot, reference, world))
    terms[world, 1] = weights[1] * wp.exp(-0.1 * joint_velocity_error(robot, reference, world))
    terms[world, 2] = weights[2] * wp.exp(-40.0 * foot_position_error(robot, reference, geometry, world))
    terms[world, 3] = weights[3] * root_pose_reward(robot, reference, world)
    terms[world, 4] = weights[4] * root_velocity_reward(robot, reference, world)
    total[world] = terms[world, 0] + terms[world, 1] + terms[world, 2] + terms[world, 3] + terms[world, 4]


@wp.kernel
def penalise_changes(
    output: wp.array2d(dtype=float),
    last_output: wp.array2d(dtype=float),
    weight: float,
    total: wp.array(dtype=float),
):
    """Subtract ``weight * |output - last output|^2`` from the reward. Launched over [num_worlds]."""
    world = wp.tid()
    change = float(0.0)
    for joint in range(12):
        step = output[world, joint] - last_output[world, joint]
        change += step * step
    total[world] = total[world] - weight * change
