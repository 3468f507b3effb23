"""From a policy's output to joint torques: joint targets, action latency, and the motors' PD law."""

import warp as wp

from kine2go_warp.kernels.reference import Placement, ReferenceClips, frame_at, interpolate_joint


@wp.struct
class MotorModel:
    """The motors of each world."""

    stiffness: wp.array2d(dtype=float)
    """[N m/rad], shape [num_worlds, 12]."""
    damping: wp.array2d(dtype=float)
    """[N m s/rad], shape [num_worlds, 12]."""
    strength: wp.array2d(dtype=float)
    """Factor on the torque [-], shape [num_worlds, 12]."""
    offset: wp.array2d(dtype=float)
    """What the motor's own angle reads too little [rad], shape [num_worlds, 12]."""
    delay: wp.array(dtype=int)
    """Latency [physics substeps], shape [num_worlds]."""
    driving: wp.array(dtype=float)
    """Largest torque with the motion, as in ``RobotSpec.motor_limits`` like the next three [N m], shape [12]."""
    braking: wp.array(dtype=float)
    """Largest torque against the motion [N m], shape [12]."""
    full_torque_speed: wp.array(dtype=float)
    """[rad/s], shape [12]."""
    no_load_speed: wp.array(dtype=float)
    """[rad/s], shape [12]."""
    friction: wp.array2d(dtype=float)
    """Coulomb friction of the joints [N m], shape [num_worlds, 12]."""
    friction_anchor: wp.array2d(dtype=float)
    """Joint position at which the friction's spring is slack [rad], shape [num_worlds, 12]."""
    friction_stiffness: float
    """Of that spring [N m/rad]."""
    friction_damping: float
    """Of that spring [N m s/rad]."""


@wp.kernel
def targets_from_default_pose(
    output: wp.array2d(dtype=float),
    default_position: wp.array(dtype=float),
    scale: float,
    clip: float,
    joint_target: wp.array2d(dtype=float),
):
    """Write ``default pose + scale * output`` (the paper's action), shape [num_worlds, 12]."""
    world, joint = wp.tid()
    joint_target[world, joint] = default_position[joint] + scale * wp.clamp(output[world, joint], -clip, clip)


@wp.kernel
def targets_from_reference(
    output: wp.array2d(dtype=float),
    clips: ReferenceClips,
    placement: Placement,
    reference_step: wp.array(dtype=int),
    steps_ahead: float,
    velocity_gain: float,
    scale: float,
    clip: float,
    joint_target: wp.array2d(dtype=float),
):
    """Write ``reference + velocity_gain * reference velocity + scale * output``, shape [num_worlds, 12].

    The reference is taken ``steps_ahead`` control steps from now, where the robot should be when the target has taken
    effect. ``velocity_gain`` [s] is the ratio of damping to stiffness: it cancels the lag of the PD law.
    """
    world, joint = wp.tid()
    index = placement.clip[world]
    frame = frame_at(clips, placement, world, float(reference_step[world]) + steps_ahead)
    position = interpolate_joint(clips, clips.joint_position, index, frame, joint)
    velocity = interpolate_joint(clips, clips.joint_velocity, index, frame, joint)
    residual = scale * wp.clamp(output[world, joint], -clip, clip)
    joint_target[world, joint] = position + velocity_gain * velocity + residual


@wp.kernel
def push_target(
    joint_target: wp.array2d(dtype=float), reference_step: wp.array(dtype=int), queue: wp.array3d(dtype=float)
):
    """Store the newest joint target in the queue of shape [num_worlds, queue_length, 12]."""
    world, joint = wp.tid()
    queue[world, reference_step[world] % queue.shape[1], joint] = joint_target[world, joint]


@wp.func
def delayed_slot(step: int, substep: int, substeps: int, delay: int, queue_length: int) -> int:
    """Return the place in the queue of the target that rules in this substep.

    A target pushed at control step ``step`` rules from ``delay`` substeps after its start. ``queue_length * substeps``
    is added so that the integer division never meets a negative number.
    """
    now = step * substeps + substep - delay + queue_length * substeps
    return (now // substeps) % queue_length


@wp.func
def available_torque(motors: MotorModel, joint: int, demand: float, velocity: float) -> float:
    """Return the largest size of a torque in the direction of the demanded one at the joint's speed [N m]."""
    if demand * velocity < 0.0:
        return motors.braking[joint]
    free, full = motors.no_load_speed[joint], motors.full_torque_speed[joint]
    return motors.driving[joint] * wp.clamp((free - wp.abs(velocity)) / (free - full), 0.0, 1.0)


@wp.func
def friction_torque(
    motors: MotorModel, world: int, joint: int, position: float, velocity: float, is_first: bool
) -> float:
    """Return the torque of the joint's Coulomb friction [N m], and let its spring slide along where it must.

    ``is_first`` says that an episode begins: the spring is slack then.
    """
    slack = position
    if not is_first:
        slack = motors.friction_anchor[world, joint]
    limit = motors.friction[world, joint]
    reach = limit / motors.friction_stiffness
    stretch = wp.clamp(position - slack, -reach, reach)
    motors.friction_anchor[world, joint] = position - stretch
    return wp.clamp(-motors.friction_stiffness * stretch - motors.friction_damping * velocity, -limit, limit)


@wp.kernel
def apply_motor_torque(
    joint_q: wp.array2d(dtype=float),
    joint_qd: wp.array2d(dtype=float),
    queue: wp.array3d(dtype=float),
    reference_step: wp.array(dtype=int),
    substep: int,
    substeps: int,
    motors: MotorModel,
    joint_force: wp.array2d(dtype=float),
    torque: wp.array2d(dtype=float),
):
    """Write each motor's limited PD torque [N m] into ``torque``, and with the joint's friction into the joint forces.

    Launched over [num_worlds, 12] before every physics substep.
    """
    world, joint = wp.tid()
    slot = delayed_slot(reference_step[world], substep, substeps, motors.delay[world], queue.shape[1])
    position, velocity = joint_q[world, 7 + joint], joint_qd[world, 6 + joint]
    error = queue[world, slot, joint] + motors.offset[world, joint] - position
    law = motors.stiffness[world, joint] * error - motors.damping[world, joint] * velocity
    demand = motors.strength[world, joint] * law
    limit = available_torque(motors, joint, demand, velocity)
    applied = wp.clamp(demand, -limit, limit)
    is_first = reference_step[world] == 0 and substep == 0
    joint_force[world, 6 + joint] = applied + friction_torque(motors, world, joint, position, velocity, is_first)
    torque[world, joint] = applied
