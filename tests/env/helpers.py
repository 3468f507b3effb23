"""What several tests of the environment share."""

import numpy as np

from kine2go_warp.env.config import ResetConfig
from kine2go_warp.env.terms.randomization import randomized

STILL = ResetConfig(1.0, 0.0, 0.0, 0.0, 0.0, 0.0)


EVERYTHING = randomized(
    base_mass=(-1.0, 2.0),
    base_com=(-0.02, 0.02),
    friction=(0.4, 1.2),
    stiffness=(0.8, 1.2),
    damping=(0.8, 1.2),
    strength=(0.9, 1.1),
    motor_offset=(-0.02, 0.02),
    joint_friction=(0.5, 1.5),
    latency=(0.0, 0.03),
    push_interval=(0.2, 0.6),
    push_speed=(0.1, 0.5),
)
"""Every range that can be drawn."""


def snapshot(environment):
    episodes = environment.episodes
    arrays = {
        "observation": environment.observation,
        "reward_terms": environment.reward_terms,
        "reward": environment.reward,
        "done": episodes.done,
        "time_out": episodes.time_out,
        "reason": episodes.reason,
        "foot_force": environment.simulation.foot_force,
        "torque": environment.motors.torque,
        "joint_q": environment.robot.joint_q,
    }
    return {name: array.numpy().copy() for name, array in arrays.items()}


def drive(environment, steps, seed):
    """Steps with the same random outputs for everyone; returns what was seen."""
    rng = np.random.default_rng(seed)
    seen = []
    for _ in range(steps):
        environment.action.assign(np.float32(rng.normal(0.0, 1.0, (environment.num_worlds, 12))))
        environment.step()
        seen.append(snapshot(environment))
    return seen


def assert_same_bits(one, other):
    for step, (a, b) in enumerate(zip(one, other, strict=True)):
        for name, value in a.items():
            assert value.tobytes() == b[name].tobytes(), f"{name} differs at step {step}"
