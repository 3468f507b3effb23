"""What motors and feet bear over the physics substeps of a control step, of which a state shows the last alone."""

import warp as wp

from kine2go_warp.kernels.actuation import MotorModel, available_torque, delayed_slot


@wp.struct
class StepLoads:
    """Of the last control step of each world."""

    applied_target: wp.array2d(dtype=float)
    """Joint target in force in the last substep [rad], shape [num_worlds, 12] like all that end in joints."""
    torque_mean: wp.array2d(dtype=float)
    """[N m]"""
    torque_peak: wp.array2d(dtype=float)
    """Largest size [N m]."""
    torque_usage: wp.array2d(dtype=float)
    """Largest share of the torque that the motor can give at the joint's speed."""
    torque_at_limit: wp.array2d(dtype=float)
    """Share of the substeps in which the torque is that large."""
    power_mean: wp.array2d(dtype=float)
    """Torque times the velocity that it leads to, which is the work done by the duration [W]."""
    power_peak: wp.array2d(dtype=float)
    """Largest size [W]."""
    force_mean: wp.array2d(dtype=wp.vec3)
    """Force of the ground on each foot, world frame [N], shape [num_worlds, 4]."""
    force_peak: wp.array2d(dtype=float)
    """Its largest size [N], shape [num_worlds, 4]."""


@wp.kernel
def add_joint_loads(
    torque: wp.array2d(dtype=float),
    joint_qd_before: wp.array2d(dtype=float),
    joint_qd: wp.array2d(dtype=float),
    queue: wp.array3d(dtype=float),
    reference_step: wp.array(dtype=int),
    substep: int,
    substeps: int,
    motors: MotorModel,
    saturation: float,
    loads: StepLoads,
):
    """Add a substep's torques. Launched over [num_worlds, 12] after it; the first one begins anew.

    ``joint_qd_before`` is what the motors saw, ``joint_qd`` what the substep led to. A torque above
    the share ``saturation`` of the motor's largest is at its limit.
    """
    world, joint = wp.tid()
    if substep == 0:
        loads.torque_mean[world, joint] = 0.0
        loads.torque_peak[world, joint] = 0.0
        loads.torque_usage[world, joint] = 0.0
        loads.torque_at_limit[world, joint] = 0.0
        loads.power_mean[world, joint] = 0.0
        loads.power_peak[world, joint] = 0.0
    slot = delayed_slot(reference_step[world], substep, substeps, motors.delay[world], queue.shape[1])
    loads.applied_target[world, joint] = queue[world, slot, joint]
    applied = torque[world, joint]
    limit = available_torque(motors, joint, applied, joint_qd_before[world, 6 + joint])
    power = applied * joint_qd[world, 6 + joint]
    share = 1.0 / float(substeps)
    loads.torque_mean[world, joint] += share * applied
    loads.torque_peak[world, joint] = wp.max(loads.torque_peak[world, joint], wp.abs(applied))
    usage = float(1.0)
    if limit > 0.0:
        usage = wp.abs(applied) / limit
    loads.torque_usage[world, joint] = wp.max(loads.torque_usage[world, joint], usage)
    if usage >= saturation:
        loads.torque_at_limit[world, joint] += share
    loads.power_mean[world, joint] += share * power
    loads.power_peak[world, joint] = wp.max(loads.power_peak[world, joint], wp.abs(power))


@wp.kernel
def add_foot_loads(foot_force: wp.array2d(dtype=wp.vec3), substep: int, substeps: int, loads: StepLoads):
    """Add a substep's forces on the feet. Launched over [num_worlds, 4] after it; the first one begins anew."""
    world, foot = wp.tid()
    if substep == 0:
        loads.force_mean[world, foot] = wp.vec3(0.0, 0.0, 0.0)
        loads.force_peak[world, foot] = 0.0
    force = foot_force[world, foot]
    loads.force_mean[world, foot] = loads.force_mean[world, foot] + force / float(substeps)
    loads.force_peak[world, foot] = wp.max(loads.force_peak[world, foot], wp.length(force))
