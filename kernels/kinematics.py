"""Forward kinematics of four legs with three joints each."""

import warp as wp

from kine2go_warp.kernels.rotations import heading_of, wxyz, yaw_rotation
from kine2go_warp.kernels.state import (
    RobotState,
    leg_joint_position,
    leg_joint_velocity,
    root_angular_velocity_w,
    root_linear_velocity_w,
    root_orientation,
    root_position,
)


@wp.struct
class LegGeometry:
    """Dimensions of the legs, FL, FR, RL, RR."""

    hip_offset: wp.array(dtype=wp.vec3)
    """Base origin to hip joint [m], shape [4]."""
    thigh_offset: wp.array(dtype=wp.vec3)
    """Hip joint to thigh joint [m], shape [4]."""
    thigh_length: float
    calf_length: float
    foot_radius: float


@wp.func
def hip_rotation(roll: float) -> wp.quat:
    """Return the rotation of the hip link in the base frame."""
    return wp.quat(wp.sin(0.5 * roll), 0.0, 0.0, wp.cos(0.5 * roll))


@wp.func
def hanging_link(length: float, pitch: float) -> wp.vec3:
    """Return a link that hangs straight down at zero pitch, in the frame of the hip link [m]."""
    return wp.vec3(-length * wp.sin(pitch), 0.0, -length * wp.cos(pitch))


@wp.func
def thigh_position_b(geometry: LegGeometry, leg: int, roll: float) -> wp.vec3:
    """Return the centre of the thigh joint in the base frame [m]."""
    return geometry.hip_offset[leg] + wp.quat_rotate(hip_rotation(roll), geometry.thigh_offset[leg])


@wp.func
def calf_position_b(geometry: LegGeometry, leg: int, roll: float, pitch: float) -> wp.vec3:
    """Return the centre of the calf joint in the base frame [m]."""
    thigh = hanging_link(geometry.thigh_length, pitch)
    return thigh_position_b(geometry, leg, roll) + wp.quat_rotate(hip_rotation(roll), thigh)


@wp.func
def foot_position_b(geometry: LegGeometry, leg: int, roll: float, pitch: float, knee: float) -> wp.vec3:
    """Return the centre of the foot in the base frame [m]."""
    calf = hanging_link(geometry.calf_length, pitch + knee)
    return calf_position_b(geometry, leg, roll, pitch) + wp.quat_rotate(hip_rotation(roll), calf)


@wp.func
def foot_position_h(orientation: wp.quat, foot_b: wp.vec3) -> wp.vec3:
    """Return a foot relative to the root, in the heading frame of the root [m]."""
    return wp.quat_rotate(yaw_rotation(-heading_of(orientation)) * orientation, foot_b)


@wp.func
def joint_axis_b(joint: int, roll: float) -> wp.vec3:
    """Return the axis of joint 0 (hip, roll), 1 (thigh, pitch) or 2 (calf, pitch) of a leg in the base frame."""
    if joint == 0:
        return wp.vec3(1.0, 0.0, 0.0)
    return wp.quat_rotate(hip_rotation(roll), wp.vec3(0.0, 1.0, 0.0))


@wp.func
def leg_point_b(geometry: LegGeometry, leg: int, point: int, q: wp.vec3) -> wp.vec3:
    """Return hip (0), thigh (1) or calf joint (2) or foot (3) of a leg in the base frame [m]."""
    if point == 0:
        return geometry.hip_offset[leg]
    if point == 1:
        return thigh_position_b(geometry, leg, q[0])
    if point == 2:
        return calf_position_b(geometry, leg, q[0], q[1])
    return foot_position_b(geometry, leg, q[0], q[1], q[2])


@wp.func
def leg_point_velocity_b(geometry: LegGeometry, leg: int, point: int, q: wp.vec3, qd: wp.vec3) -> wp.vec3:
    """Return the velocity of a leg point relative to the base, in the base frame [m/s]."""
    position = leg_point_b(geometry, leg, point, q)
    velocity = wp.vec3(0.0, 0.0, 0.0)
    for joint in range(3):
        if joint < point:
            arm = position - leg_point_b(geometry, leg, joint, q)
            velocity += wp.cross(joint_axis_b(joint, q[0]), arm) * qd[joint]
    return velocity


@wp.func
def leg_point_velocity_w(robot: RobotState, geometry: LegGeometry, world: int, leg: int, point: int) -> wp.vec3:
    """Return the velocity of hip (0), thigh (1) or calf joint (2) or foot (3) of a leg in the world [m/s]."""
    q = leg_joint_position(robot, world, leg)
    qd = leg_joint_velocity(robot, world, leg)
    rotation = root_orientation(robot, world)
    arm_w = wp.quat_rotate(rotation, leg_point_b(geometry, leg, point, q))
    relative_w = wp.quat_rotate(rotation, leg_point_velocity_b(geometry, leg, point, q, qd))
    return root_linear_velocity_w(robot, world) + wp.cross(root_angular_velocity_w(robot, world), arm_w) + relative_w


@wp.func
def link_rotation_b(point: int, q: wp.vec3) -> wp.quat:
    """Return the orientation of hip (0), thigh (1), calf (2) or foot (3), which is fixed to the calf, in the base."""
    pitch = float(0.0)
    if point > 0:
        pitch = q[1]
    if point > 1:
        pitch += q[2]
    return hip_rotation(q[0]) * wp.quat(0.0, wp.sin(0.5 * pitch), 0.0, wp.cos(0.5 * pitch))


@wp.func
def link_angular_velocity_b(point: int, q: wp.vec3, qd: wp.vec3) -> wp.vec3:
    """Return the angular velocity of such a link relative to the base, in the base frame [rad/s]."""
    velocity = wp.vec3(0.0, 0.0, 0.0)
    for joint in range(3):
        if joint <= point:
            velocity += joint_axis_b(joint, q[0]) * qd[joint]
    return velocity


@wp.kernel
def link_states(
    robot: RobotState,
    geometry: LegGeometry,
    position: wp.array2d(dtype=wp.vec3),
    orientation: wp.array2d(dtype=wp.vec4),
    velocity: wp.array2d(dtype=wp.vec3),
    angular_velocity: wp.array2d(dtype=wp.vec3),
):
    """Write pose and velocities of 12 leg links and 4 feet in the world, shape [num_worlds, 16].

    Positions [m] and velocities [m/s] are those of the joint centres and feet, orientations are (w, x, y, z), angular
    velocities in rad/s. Launched over [num_worlds, 4 legs, 4 points].
    """
    world, leg, point = wp.tid()
    slot = 3 * leg + point
    if point == 3:
        slot = 12 + leg
    q = leg_joint_position(robot, world, leg)
    qd = leg_joint_velocity(robot, world, leg)
    root = root_orientation(robot, world)
    position[world, slot] = root_position(robot, world) + wp.quat_rotate(root, leg_point_b(geometry, leg, point, q))
    orientation[world, slot] = wxyz(root * link_rotation_b(point, q))
    velocity[world, slot] = leg_point_velocity_w(robot, geometry, world, leg, point)
    turning_b = link_angular_velocity_b(point, q, qd)
    angular_velocity[world, slot] = root_angular_velocity_w(robot, world) + wp.quat_rotate(root, turning_b)
