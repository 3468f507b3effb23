"""Observations: one kernel each, launched over [num_worlds], which writes its values from ``column`` on.

The policy sees its own recent states and the coming reference, without absolute position or heading; the critic may
also see what no real robot knows.
"""

import warp as wp

from kine2go_warp.kernels.reference import frame_at, interpolate_joint, reference_root
from kine2go_warp.kernels.rotations import heading_of, yaw_rotation
from kine2go_warp.kernels.state import (
    NUM_JOINTS,
    NUM_LEGS,
    RobotState,
    joint_position,
    joint_velocity,
    root_angular_velocity_w,
    root_linear_velocity_w,
    root_orientation,
    root_position,
)
from kine2go_warp.kernels.terrain import ground_height
from kine2go_warp.kernels.world import WorldView


@wp.func
def write_vector(out: wp.array2d(dtype=float), world: int, first: int, vector: wp.vec3):
    """Write three components side by side."""
    for axis in range(3):
        out[world, first + axis] = vector[axis]


@wp.func
def world_to_heading(robot: RobotState, world: int) -> wp.quat:
    """Return the rotation from the world to the robot's heading frame."""
    return yaw_rotation(-heading_of(root_orientation(robot, world)))


@wp.func
def future_frame(view: WorldView, world: int) -> float:
    """Return the place in the clip ``view.ahead`` control steps from now [frames]."""
    return frame_at(view.clips, view.placement, world, float(view.reference_step[world] + view.ahead))


@wp.func
def future_axis_h(view: WorldView, world: int, axis: wp.vec3) -> wp.vec3:
    """Return an axis of the future reference root in the robot's heading frame."""
    root = reference_root(view.clips, view.placement, world, future_frame(view, world))
    rotation = world_to_heading(view.robot, world) * wp.transform_get_rotation(root)
    return wp.quat_rotate(rotation, axis)


@wp.kernel
def shift_history(observation: wp.array2d(dtype=float), history_length: int, state_size: int):
    """Move each state of the history one place back, dropping the oldest. Launched over [num_worlds, state_size]."""
    world, index = wp.tid()
    for age in range(history_length - 1, 0, -1):
        observation[world, age * state_size + index] = observation[world, (age - 1) * state_size + index]


@wp.kernel
def fill_history(
    done: wp.array(dtype=wp.int64), observation: wp.array2d(dtype=float), history_length: int, state_size: int
):
    """Give a world that begins an episode a history of its first state. Launched over [num_worlds, state_size]."""
    world, index = wp.tid()
    if done[world] == wp.int64(0):
        return
    for age in range(1, history_length):
        observation[world, age * state_size + index] = observation[world, index]


@wp.kernel
def remember_actions(view: WorldView):
    """Keep the actions for the next step, zeros in worlds that begin an episode. Launched over [num_worlds, 12]."""
    world, joint = wp.tid()
    view.last_action[world, joint] = wp.where(view.done[world] == wp.int64(0), view.action[world, joint], 0.0)


@wp.kernel
def down_b(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Write the direction of gravity in the base frame [-]."""
    world = wp.tid()
    rotation = root_orientation(view.robot, world)
    write_vector(out, world, column, wp.quat_rotate_inv(rotation, wp.vec3(0.0, 0.0, -1.0)))


@wp.kernel
def linear_velocity_b(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Write the velocity of the base origin in the base frame [m/s]."""
    world = wp.tid()
    rotation = root_orientation(view.robot, world)
    write_vector(out, world, column, wp.quat_rotate_inv(rotation, root_linear_velocity_w(view.robot, world)))


@wp.kernel
def angular_velocity_b(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Write the angular velocity in the base frame [rad/s]."""
    world = wp.tid()
    rotation = root_orientation(view.robot, world)
    write_vector(out, world, column, wp.quat_rotate_inv(rotation, root_angular_velocity_w(view.robot, world)))


@wp.kernel
def joint_positions(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Write the joint positions less the default pose [rad]."""
    world = wp.tid()
    for joint in range(NUM_JOINTS):
        out[world, column + joint] = joint_position(view.robot, world, joint) - view.default_position[joint]


@wp.kernel
def joint_velocities(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Write the joint velocities [rad/s]."""
    world = wp.tid()
    for joint in range(NUM_JOINTS):
        out[world, column + joint] = joint_velocity(view.robot, world, joint)


@wp.kernel
def last_action(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Write the last action [-]."""
    world = wp.tid()
    for joint in range(NUM_JOINTS):
        out[world, column + joint] = view.last_action[world, joint]


@wp.kernel
def reference_position_h(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Write the future reference root less the robot's root, in the robot's heading frame [m]."""
    world = wp.tid()
    root = reference_root(view.clips, view.placement, world, future_frame(view, world))
    offset = wp.transform_get_translation(root) - root_position(view.robot, world)
    write_vector(out, world, column, wp.quat_rotate(world_to_heading(view.robot, world), offset))


@wp.kernel
def reference_forward_h(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Write the forward axis of the future reference root, in the robot's heading frame [-]."""
    world = wp.tid()
    write_vector(out, world, column, future_axis_h(view, world, wp.vec3(1.0, 0.0, 0.0)))


@wp.kernel
def reference_left_h(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Write the left axis of the future reference root, in the robot's heading frame [-]."""
    world = wp.tid()
    write_vector(out, world, column, future_axis_h(view, world, wp.vec3(0.0, 1.0, 0.0)))


@wp.kernel
def reference_joint_positions(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Write the future reference joint positions less the default pose [rad]."""
    world = wp.tid()
    clip, frame = view.placement.clip[world], future_frame(view, world)
    for joint in range(NUM_JOINTS):
        position = interpolate_joint(view.clips, view.clips.joint_position, clip, frame, joint)
        out[world, column + joint] = position - view.default_position[joint]


@wp.kernel
def root_height(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Write the height of the root above the ground [m]."""
    world = wp.tid()
    position = root_position(view.robot, world)
    out[world, column] = position[2] - ground_height(view.placement.terrain, wp.vec2(position[0], position[1]))


@wp.kernel
def linear_velocity_h(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Write the velocity of the base origin in the heading frame [m/s]."""
    world = wp.tid()
    velocity = root_linear_velocity_w(view.robot, world)
    write_vector(out, world, column, wp.quat_rotate(world_to_heading(view.robot, world), velocity))


@wp.kernel
def angular_velocity_h(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Write the angular velocity in the heading frame [rad/s]."""
    world = wp.tid()
    velocity = root_angular_velocity_w(view.robot, world)
    write_vector(out, world, column, wp.quat_rotate(world_to_heading(view.robot, world), velocity))


@wp.kernel
def foot_force_h(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Write the forces on the feet in the heading frame [weights of the robot]."""
    world = wp.tid()
    to_heading = world_to_heading(view.robot, world)
    for foot in range(NUM_LEGS):
        force = wp.quat_rotate(to_heading, view.foot_force[world, foot]) / view.robot_weight
        write_vector(out, world, column + 3 * foot, force)


@wp.kernel
def base_mass(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Write the mass added to the base [kg]."""
    world = wp.tid()
    out[world, column] = view.base.mass[world] - view.base.nominal_mass


@wp.kernel
def base_com(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Write the shift of the base's centre of mass [m]."""
    world = wp.tid()
    write_vector(out, world, column, view.base.com[world] - view.base.nominal_com)


@wp.kernel
def friction(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Write the coefficient of friction [-]."""
    world = wp.tid()
    out[world, column] = view.friction[world]


@wp.kernel
def stiffness(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Write the factors on the motors' stiffness less 1 [-]."""
    world = wp.tid()
    for joint in range(NUM_JOINTS):
        out[world, column + joint] = view.motors.stiffness[world, joint] / view.nominal_stiffness - 1.0


@wp.kernel
def damping(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Write the factors on the motors' damping less 1 [-]."""
    world = wp.tid()
    for joint in range(NUM_JOINTS):
        out[world, column + joint] = view.motors.damping[world, joint] / view.nominal_damping - 1.0


@wp.kernel
def strength(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Write the factors on the motors' torque less 1 [-]."""
    world = wp.tid()
    for joint in range(NUM_JOINTS):
        out[world, column + joint] = view.motors.strength[world, joint] - 1.0


@wp.kernel
def motor_offset(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Write the errors of the motors' zero angles [rad]."""
    world = wp.tid()
    for joint in range(NUM_JOINTS):
        out[world, column + joint] = view.motors.offset[world, joint]


@wp.kernel
def joint_friction(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Write the Coulomb friction of the joints [N m]."""
    world = wp.tid()
    for joint in range(NUM_JOINTS):
        out[world, column + joint] = view.motors.friction[world, joint]


@wp.kernel
def latency(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Write the time from an action to its effect [physics substeps]."""
    world = wp.tid()
    out[world, column] = float(view.motors.delay[world])
