"""What the policy sees: its own recent states and the coming reference, without absolute position or heading."""

import warp as wp

from kine2go_warp.kernels.actuation import MotorModel
from kine2go_warp.kernels.reference import Placement, ReferenceClips, frame_at, interpolate_joint, reference_root
from kine2go_warp.kernels.rotations import heading_of, yaw_rotation
from kine2go_warp.kernels.state import (
    RobotState,
    joint_position,
    joint_velocity,
    root_angular_velocity_w,
    root_linear_velocity_w,
    root_orientation,
    root_position,
)
from kine2go_warp.kernels.terrain import ground_height
from kine2go_warp.kernels.world import BaseBody

wp.set_module_options({"enable_backward": False})

STATE_SIZE = wp.constant(45)
"""Values of one state: see ``write_state``."""
TARGET_SIZE = wp.constant(21)
"""Values of one future reference: see ``observe_targets``."""
PRIVILEGED_SIZE = wp.constant(73)
"""Values that only the critic sees: see ``observe_privileged``."""


@wp.func
def write_vector(out: wp.array2d(dtype=float), world: int, first: int, vector: wp.vec3):
    """Write three components side by side."""
    for axis in range(3):
        out[world, first + axis] = vector[axis]


@wp.kernel
def shift_history(observation: wp.array2d(dtype=float), history_length: int):
    """Move each state of the history one place back, dropping the oldest. Launched over [num_worlds, 45]."""
    world, index = wp.tid()
    for age in range(history_length - 1, 0, -1):
        observation[world, age * STATE_SIZE + index] = observation[world, (age - 1) * STATE_SIZE + index]


@wp.kernel
def observe_state(
    robot: RobotState,
    last_action: wp.array2d(dtype=float),
    default_position: wp.array(dtype=float),
    observation: wp.array2d(dtype=float),
):
    """Write the robot's present state to the first 45 places of the observation.

    Down direction (3) [-], linear velocity of the base origin (3) [m/s] and angular velocity (3) [rad/s], all in the
    base frame; joint positions less the default pose (12) [rad]; joint velocities (12) [rad/s]; the last action of the
    policy (12) [-].
    """
    world = wp.tid()
    rotation = root_orientation(robot, world)
    write_vector(observation, world, 0, wp.quat_rotate_inv(rotation, wp.vec3(0.0, 0.0, -1.0)))
    write_vector(observation, world, 3, wp.quat_rotate_inv(rotation, root_linear_velocity_w(robot, world)))
    write_vector(observation, world, 6, wp.quat_rotate_inv(rotation, root_angular_velocity_w(robot, world)))
    for joint in range(12):
        observation[world, 9 + joint] = joint_position(robot, world, joint) - default_position[joint]
        observation[world, 21 + joint] = joint_velocity(robot, world, joint)
        observation[world, 33 + joint] = last_action[world, joint]


@wp.kernel
def fill_history(done: wp.array(dtype=wp.int64), observation: wp.array2d(dtype=float), history_length: int):
    """Give a world that begins an episode a history of copies of its first state. Launched over [num_worlds, 45]."""
    world, index = wp.tid()
    if done[world] == wp.int64(0):
        return
    for age in range(1, history_length):
        observation[world, age * STATE_SIZE + index] = observation[world, index]


@wp.kernel
def observe_targets(
    robot: RobotState,
    clips: ReferenceClips,
    placement: Placement,
    reference_step: wp.array(dtype=int),
    steps_ahead: wp.array(dtype=int),
    default_position: wp.array(dtype=float),
    first: int,
    observation: wp.array2d(dtype=float),
):
    """Write the reference at several future steps, seen from the robot, 21 values each.

    Reference root relative to the robot's root in the robot's heading frame (3) [m]; forward and left axis of the
    reference root in that frame (6) [-]; reference joint positions less the default pose (12) [rad]. Launched over
    [num_worlds, number of steps].
    """
    world, target = wp.tid()
    clip = placement.clip[world]
    frame = frame_at(clips, placement, world, float(reference_step[world] + steps_ahead[target]))
    root = reference_root(clips, placement, world, frame)
    to_heading = yaw_rotation(-heading_of(root_orientation(robot, world)))
    offset = wp.quat_rotate(to_heading, wp.transform_get_translation(root) - root_position(robot, world))
    rotation = to_heading * wp.transform_get_rotation(root)
    place = first + target * TARGET_SIZE
    write_vector(observation, world, place, offset)
    write_vector(observation, world, place + 3, wp.quat_rotate(rotation, wp.vec3(1.0, 0.0, 0.0)))
    write_vector(observation, world, place + 6, wp.quat_rotate(rotation, wp.vec3(0.0, 1.0, 0.0)))
    for joint in range(12):
        position = interpolate_joint(clips, clips.joint_position, clip, frame, joint)
        observation[world, place + 9 + joint] = position - default_position[joint]


@wp.kernel
def remember_actions(
    done: wp.array(dtype=wp.int64), action: wp.array2d(dtype=float), last_action: wp.array2d(dtype=float)
):
    """Keep the actions for the next step, zeros in worlds that begin an episode. Launched over [num_worlds, 12]."""
    world, joint = wp.tid()
    last_action[world, joint] = wp.where(done[world] == wp.int64(0), action[world, joint], 0.0)


@wp.kernel
def observe_privileged(
    robot: RobotState,
    placement: Placement,
    foot_force: wp.array2d(dtype=wp.vec3),
    motors: MotorModel,
    base: BaseBody,
    friction: wp.array(dtype=float),
    nominal_stiffness: float,
    nominal_damping: float,
    weight: float,
    out: wp.array2d(dtype=float),
):
    """Write what no real robot knows, for the critic alone, shape [num_worlds, 73].

    Height of the root above the ground (1) [m]; velocity of the base origin (3) [m/s], angular velocity (3) [rad/s]
    and forces on the feet (12) [weights of the robot], all in the heading frame; mass added to the base (1) [kg] and
    shift of its centre of mass (3) [m]; friction (1); factors on stiffness, damping and strength less 1 (36); offset
    of the joints (12) [rad]; latency (1) [physics substeps].
    """
    world = wp.tid()
    position = root_position(robot, world)
    to_heading = yaw_rotation(-heading_of(root_orientation(robot, world)))
    out[world, 0] = position[2] - ground_height(placement.terrain, wp.vec2(position[0], position[1]))
    write_vector(out, world, 1, wp.quat_rotate(to_heading, root_linear_velocity_w(robot, world)))
    write_vector(out, world, 4, wp.quat_rotate(to_heading, root_angular_velocity_w(robot, world)))
    for foot in range(4):
        write_vector(out, world, 7 + 3 * foot, wp.quat_rotate(to_heading, foot_force[world, foot]) / weight)
    out[world, 19] = base.mass[world] - base.nominal_mass
    write_vector(out, world, 20, base.com[world] - base.nominal_com)
    out[world, 23] = friction[world]
    for joint in range(12):
        out[world, 24 + joint] = motors.stiffness[world, joint] / nominal_stiffness - 1.0
        out[world, 36 + joint] = motors.damping[world, joint] / nominal_damping - 1.0
        out[world, 48 + joint] = motors.strength[world, joint] - 1.0
        out[world, 60 + joint] = motors.offset[world, joint]
    out[world, 72] = float(motors.delay[world])
