"""Between the two conventions for the state of a robot: Newton's, in which it is kept, and MuJoCo's."""

import warp as wp

from kine2go_warp.kernels.state import (
    FIRST_JOINT_Q,
    FIRST_JOINT_QD,
    NUM_JOINTS,
    RobotState,
    com_velocity_w,
    root_angular_velocity_w,
    root_linear_velocity_w,
    root_orientation,
)


@wp.kernel
def push_state(robot: RobotState, qpos: wp.array2d(dtype=float), qvel: wp.array2d(dtype=float)):
    """Write the state as MuJoCo takes it: quaternion (w, x, y, z), velocity of the base's origin, base-fixed rates.

    Launched over [num_worlds].
    """
    world = wp.tid()
    orientation = root_orientation(robot, world)
    velocity = root_linear_velocity_w(robot, world)
    rates = wp.quat_rotate_inv(orientation, root_angular_velocity_w(robot, world))
    for axis in range(3):
        qpos[world, axis] = robot.joint_q[world, axis]
        qpos[world, 4 + axis] = orientation[axis]
        qvel[world, axis] = velocity[axis]
        qvel[world, 3 + axis] = rates[axis]
    qpos[world, 3] = orientation[3]
    for joint in range(NUM_JOINTS):
        qpos[world, FIRST_JOINT_Q + joint] = robot.joint_q[world, FIRST_JOINT_Q + joint]
        qvel[world, FIRST_JOINT_QD + joint] = robot.joint_qd[world, FIRST_JOINT_QD + joint]


@wp.kernel
def pull_state(qpos: wp.array2d(dtype=float), qvel: wp.array2d(dtype=float), robot: RobotState):
    """Read what ``push_state`` writes. Launched over [num_worlds]."""
    world = wp.tid()
    orientation = wp.quat(qpos[world, 4], qpos[world, 5], qpos[world, 6], qpos[world, 3])
    rates = wp.quat_rotate(orientation, wp.vec3(qvel[world, 3], qvel[world, 4], qvel[world, 5]))
    origin_velocity = wp.vec3(qvel[world, 0], qvel[world, 1], qvel[world, 2])
    velocity = com_velocity_w(origin_velocity, rates, orientation, robot.com_b[world])
    for axis in range(3):
        robot.joint_q[world, axis] = qpos[world, axis]
        robot.joint_qd[world, axis] = velocity[axis]
        robot.joint_qd[world, 3 + axis] = rates[axis]
    for part in range(4):
        robot.joint_q[world, 3 + part] = orientation[part]
    for joint in range(NUM_JOINTS):
        robot.joint_q[world, FIRST_JOINT_Q + joint] = qpos[world, FIRST_JOINT_Q + joint]
        robot.joint_qd[world, FIRST_JOINT_QD + joint] = qvel[world, FIRST_JOINT_QD + joint]
