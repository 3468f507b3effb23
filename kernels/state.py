"""Access to Newton's generalised coordinates of a floating base with twelve joints."""

import warp as wp

NUM_LEGS = wp.constant(4)
NUM_JOINTS = wp.constant(12)
NUM_COORDINATES = wp.constant(19)
"""Generalised coordinates: position and quaternion of the base, then the joints."""
NUM_VELOCITIES = wp.constant(18)
"""Generalised velocities."""
FIRST_JOINT_Q = wp.constant(7)
"""Place of the first joint in the generalised coordinates."""
FIRST_JOINT_QD = wp.constant(6)
"""Place of the first joint in the generalised velocities."""


@wp.struct
class RobotState:
    """Newton's own buffers, viewed by world."""

    joint_q: wp.array2d(dtype=float)
    """Base origin (world) [m], base orientation (x, y, z, w), joint positions [rad], shape [num_worlds, 19]."""
    joint_qd: wp.array2d(dtype=float)
    """Velocity of the base's *centre of mass* (world) [m/s], angular velocity (world) [rad/s], joint velocities
    [rad/s], shape [num_worlds, 18]."""
    com_b: wp.array(dtype=wp.vec3)
    """Centre of mass of the base link in its own frame [m], shape [num_worlds]."""


@wp.func
def root_orientation(robot: RobotState, world: int) -> wp.quat:
    """Return the orientation of the base link in the world."""
    return wp.quat(robot.joint_q[world, 3], robot.joint_q[world, 4], robot.joint_q[world, 5], robot.joint_q[world, 6])


@wp.func
def root_position(robot: RobotState, world: int) -> wp.vec3:
    """Return the base link origin in the world [m]."""
    return wp.vec3(robot.joint_q[world, 0], robot.joint_q[world, 1], robot.joint_q[world, 2])


@wp.func
def joint_position(robot: RobotState, world: int, joint: int) -> float:
    """Return a joint position [rad]."""
    return robot.joint_q[world, FIRST_JOINT_Q + joint]


@wp.func
def joint_velocity(robot: RobotState, world: int, joint: int) -> float:
    """Return a joint velocity [rad/s]."""
    return robot.joint_qd[world, FIRST_JOINT_QD + joint]


@wp.func
def leg_joint_position(robot: RobotState, world: int, leg: int) -> wp.vec3:
    """Return hip, thigh and calf position of a leg [rad]."""
    first = FIRST_JOINT_Q + 3 * leg
    return wp.vec3(robot.joint_q[world, first], robot.joint_q[world, first + 1], robot.joint_q[world, first + 2])


@wp.func
def leg_joint_velocity(robot: RobotState, world: int, leg: int) -> wp.vec3:
    """Return hip, thigh and calf velocity of a leg [rad/s]."""
    first = FIRST_JOINT_QD + 3 * leg
    return wp.vec3(robot.joint_qd[world, first], robot.joint_qd[world, first + 1], robot.joint_qd[world, first + 2])


@wp.func
def root_angular_velocity_w(robot: RobotState, world: int) -> wp.vec3:
    """Return the angular velocity of the base in the world frame [rad/s]."""
    return wp.vec3(robot.joint_qd[world, 3], robot.joint_qd[world, 4], robot.joint_qd[world, 5])


@wp.func
def root_linear_velocity_w(robot: RobotState, world: int) -> wp.vec3:
    """Return the velocity of the base link *origin* in the world frame [m/s]."""
    com_velocity = wp.vec3(robot.joint_qd[world, 0], robot.joint_qd[world, 1], robot.joint_qd[world, 2])
    arm = wp.quat_rotate(root_orientation(robot, world), robot.com_b[world])
    return com_velocity - wp.cross(root_angular_velocity_w(robot, world), arm)


@wp.func
def is_finite(robot: RobotState, world: int) -> bool:
    """Return whether every coordinate of a world is a finite number."""
    for index in range(NUM_COORDINATES):
        if not wp.isfinite(robot.joint_q[world, index]):
            return False
    for index in range(NUM_VELOCITIES):  # noqa: SIM110 - Warp has no generators
        if not wp.isfinite(robot.joint_qd[world, index]):
            return False
    return True


@wp.func
def com_velocity_w(
    origin_velocity: wp.vec3, angular_velocity: wp.vec3, orientation: wp.quat, com_b: wp.vec3
) -> wp.vec3:
    """Return the velocity of the centre of mass from that of the base link origin [m/s], all in the world frame."""
    return origin_velocity + wp.cross(angular_velocity, wp.quat_rotate(orientation, com_b))
