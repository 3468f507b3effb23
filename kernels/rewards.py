"""Rewards: one kernel each, launched over [num_worlds], which writes the value before its weight.

The tracking rewards are the paper's (appendix, "Reward structure"), pure functions of squared errors.
"""

import warp as wp

from kine2go_warp.kernels.kinematics import LegGeometry, foot_position_b, foot_position_h
from kine2go_warp.kernels.reference import ReferenceState
from kine2go_warp.kernels.rotations import rotation_angle
from kine2go_warp.kernels.state import (
    NUM_JOINTS,
    NUM_LEGS,
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
from kine2go_warp.kernels.world import WorldView


@wp.func
def joint_position_error(robot: RobotState, reference: ReferenceState, world: int) -> float:
    """Return the summed squared joint position error [rad^2]."""
    total = float(0.0)
    for joint in range(NUM_JOINTS):
        error = joint_position(robot, world, joint) - reference.joint_position[world, joint]
        total += error * error
    return total


@wp.func
def joint_velocity_error(robot: RobotState, reference: ReferenceState, world: int) -> float:
    """Return the summed squared joint velocity error [rad^2/s^2]."""
    total = float(0.0)
    for joint in range(NUM_JOINTS):
        error = joint_velocity(robot, world, joint) - reference.joint_velocity[world, joint]
        total += error * error
    return total


@wp.func
def foot_position_error(robot: RobotState, reference: ReferenceState, geometry: LegGeometry, world: int) -> float:
    """Return the summed squared error of the feet relative to the root, each in its own heading frame [m^2]."""
    total = float(0.0)
    rotation = root_orientation(robot, world)
    reference_rotation = wp.transform_get_rotation(reference.root[world])
    for leg in range(NUM_LEGS):
        q = leg_joint_position(robot, world, leg)
        foot = foot_position_h(rotation, foot_position_b(geometry, leg, q[0], q[1], q[2]))
        first = 3 * leg
        reference_foot_b = foot_position_b(
            geometry,
            leg,
            reference.joint_position[world, first],
            reference.joint_position[world, first + 1],
            reference.joint_position[world, first + 2],
        )
        total += wp.length_sq(foot - foot_position_h(reference_rotation, reference_foot_b))
    return total


@wp.kernel
def track_joint_position(view: WorldView, out: wp.array2d(dtype=float), column: int, exponent: float):
    """Write exp(-exponent * summed squared joint position error)."""
    world = wp.tid()
    out[world, column] = wp.exp(-exponent * joint_position_error(view.robot, view.reference, world))


@wp.kernel
def track_joint_velocity(view: WorldView, out: wp.array2d(dtype=float), column: int, exponent: float):
    """Write exp(-exponent * summed squared joint velocity error)."""
    world = wp.tid()
    out[world, column] = wp.exp(-exponent * joint_velocity_error(view.robot, view.reference, world))


@wp.kernel
def track_foot_position(view: WorldView, out: wp.array2d(dtype=float), column: int, exponent: float):
    """Write exp(-exponent * summed squared error of the feet relative to the root)."""
    world = wp.tid()
    out[world, column] = wp.exp(-exponent * foot_position_error(view.robot, view.reference, view.geometry, world))


@wp.kernel
def track_root_pose(
    view: WorldView, out: wp.array2d(dtype=float), column: int, position_exponent: float, angle_exponent: float
):
    """Write exp(-position_exponent * |position error|^2) + exp(-angle_exponent * angle^2)."""
    world = wp.tid()
    root = view.reference.root[world]
    distance_sq = wp.length_sq(root_position(view.robot, world) - wp.transform_get_translation(root))
    angle = rotation_angle(root_orientation(view.robot, world), wp.transform_get_rotation(root))
    out[world, column] = wp.exp(-position_exponent * distance_sq) + wp.exp(-angle_exponent * angle * angle)


@wp.kernel
def track_root_velocity(
    view: WorldView, out: wp.array2d(dtype=float), column: int, linear_exponent: float, angular_exponent: float
):
    """Write exp(-linear_exponent * |v error|^2) + exp(-angular_exponent * |w error|^2), both in the world frame."""
    world = wp.tid()
    linear_sq = wp.length_sq(root_linear_velocity_w(view.robot, world) - view.reference.linear_velocity[world])
    angular_sq = wp.length_sq(root_angular_velocity_w(view.robot, world) - view.reference.angular_velocity[world])
    out[world, column] = wp.exp(-linear_exponent * linear_sq) + wp.exp(-angular_exponent * angular_sq)


@wp.kernel
def action_rate(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Write |action - last action|^2."""
    world = wp.tid()
    change = float(0.0)
    for joint in range(NUM_JOINTS):
        step = view.action[world, joint] - view.last_action[world, joint]
        change += step * step
    out[world, column] = change


@wp.kernel
def sum_rewards(
    robot: RobotState, weights: wp.array(dtype=float), terms: wp.array2d(dtype=float), total: wp.array(dtype=float)
):
    """Weight the terms, shape [num_worlds, number of terms], and add them up in their order.

    A world whose state is not finite earns nothing: one such number would spread through the learner to all worlds.
    """
    world = wp.tid()
    finite = is_finite(robot, world)
    reward = float(0.0)
    for term in range(weights.shape[0]):
        terms[world, term] = wp.where(finite, weights[term] * terms[world, term], 0.0)
        reward += terms[world, term]
    total[world] = reward
