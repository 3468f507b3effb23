"""Where a world lies and which way it faces must not matter."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from kine2go_warp.env.environment import ImitationEnvironment


def move_worlds(environment, yaw, shift):
    """Turns every world by its own angle and moves it, robot and reference together."""
    episodes, robot = environment.episodes, environment.robot
    turn = Rotation.from_euler("z", yaw[:, None])
    joint_q, joint_qd = robot.joint_q.numpy().astype(float), robot.joint_qd.numpy().astype(float)
    joint_q[:, :3] = turn.apply(joint_q[:, :3]) + np.c_[shift, np.zeros(len(yaw))]
    joint_q[:, 3:7] = (turn * Rotation.from_quat(joint_q[:, 3:7])).as_quat()
    joint_qd[:, :3], joint_qd[:, 3:6] = turn.apply(joint_qd[:, :3]), turn.apply(joint_qd[:, 3:6])
    robot.joint_q.assign(np.float32(joint_q))
    robot.joint_qd.assign(np.float32(joint_qd))
    origin = np.c_[episodes.placement.origin.numpy(), np.zeros(len(yaw))]
    episodes.placement.heading.assign(np.float32(episodes.placement.heading.numpy() + yaw))
    episodes.placement.origin.assign(np.float32(turn.apply(origin)[:, :2] + shift))
    force = environment.simulation.foot_force.numpy().astype(float)
    force = np.stack([turn.apply(force[:, foot]) for foot in range(4)], axis=1)
    environment.simulation.foot_force.assign(np.float32(force))


def test_turning_and_moving_world_and_reference_together_changes_neither_reward_nor_observation(
    clip, small_config, rng
):
    config = replace(small_config, num_worlds=64, history_length=1, privileged=True)
    environment = ImitationEnvironment([clip], config, "cpu", use_graph=False)
    for _ in range(10):
        environment.action.assign(np.float32(rng.normal(0.0, 0.4, (64, 12))))
        environment.step()
    environment._evaluate()
    environment.episodes.done.zero_()
    environment._observe()
    expected = [
        array.numpy().copy()
        for array in (environment.observation, environment.privileged_observation, environment.reward_terms)
    ]
    move_worlds(environment, rng.uniform(-np.pi, np.pi, 64), rng.uniform(-5.0, 5.0, (64, 2)))
    environment._evaluate()
    environment.episodes.done.zero_()
    environment._observe()
    found = (environment.observation, environment.privileged_observation, environment.reward_terms)
    for one, other in zip(found, expected, strict=True):
        # Places of some metres in single precision are known to 1e-6 m, which exp(-40 x^2) does not enlarge.
        np.testing.assert_allclose(one.numpy(), other, atol=2e-5)
