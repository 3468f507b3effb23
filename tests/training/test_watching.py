"""Watching a training changes nothing of it and shows what the worlds do."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch

from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.learning.presets import FAST
from kine2go_warp.learning.vec_env import ImitationVecEnv
from kine2go_warp.rollouts.recorder import RolloutRecorder
from kine2go_warp.training.parallel import ParallelVecEnv
from kine2go_warp.training.train import train
from kine2go_warp.training.watching import BLOCK, INTERVAL, NUM_WORLDS, STRETCH, WorldSampler


class Eyes:
    """Keeps all that it is shown."""

    def __init__(self):
        self.blocks, self.iterations = [], []

    def on_worlds(self, time, rows):
        self.blocks.append((time, rows))

    def on_iteration(self, time, iteration, curves):
        self.iterations.append((time, iteration, curves))

    def rows(self, name):
        return np.concatenate([rows[name] for _, rows in self.blocks], axis=1)


@pytest.fixture
def clock():
    """A clock that stands still unless told otherwise."""
    return SimpleNamespace(now=0.0)


def test_the_worlds_are_seen_as_the_recorder_of_rollouts_sees_them(clip, small_config, rng, clock):
    environment = ImitationEnvironment([clip], small_config, "cpu", record_loads=True)
    env, eyes = ImitationVecEnv(environment), Eyes()
    env.on_step = WorldSampler(env, eyes, 0, lambda: clock.now).step_done
    recorder = RolloutRecorder(environment, SimpleNamespace())
    ended = 0
    for _ in range(2 * BLOCK):
        env.episode_length_buf[1] = environment.config.max_episode_length - 1 if ended == 0 else 0
        env.step(torch.from_numpy(np.float32(rng.normal(0.0, 0.4, (env.num_envs, 12)))))
        ended += int(env.buffers.done[1])
        recorder.record_state(torch.zeros(env.num_envs, 12))
    names = ("root_position", "root_orientation", "joint_position", "foot_contact_force", "reference_root_position",
             "reference_root_orientation", "reference_joint_position")  # fmt: skip
    assert ended >= 1, "a world began a new episode"
    assert np.concatenate([time for time, _ in eyes.blocks]) == pytest.approx(np.arange(1, 2 * BLOCK + 1) / 60.0)
    for name in names:
        last = recorder._views[name][:NUM_WORLDS].numpy()
        np.testing.assert_allclose(eyes.rows(name)[:, -1], last, atol=1e-6, err_msg=name)


def test_stretches_begin_at_intervals_and_are_whole(environment, clock):
    env, eyes = ImitationVecEnv(environment), Eyes()
    env.on_step = WorldSampler(env, eyes, 600, lambda: clock.now).step_done
    actions = torch.zeros(env.num_envs, 12)
    for _ in range(STRETCH + 20):
        env.step(actions)
    assert eyes.rows("root_position").shape == (NUM_WORLDS, STRETCH, 3)
    assert eyes.blocks[0][0][0] == pytest.approx(601 / 60.0), "after 600 steps that were trained before"
    clock.now = INTERVAL
    for _ in range(BLOCK):
        env.step(actions)
    assert eyes.rows("root_position").shape == (NUM_WORLDS, STRETCH + BLOCK, 3)
    assert eyes.blocks[-1][0][0] == pytest.approx((600 + STRETCH + 20 + 1) / 60.0)


@pytest.mark.parametrize("processes", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_watched_training_ends_with_the_same_policy(clip, tmp_path, processes):
    config, eyes = FAST.override({"env.num_worlds": 8, "ppo.iterations": 3}), Eyes()
    train([clip], config, tmp_path / "watched", "cpu", processes=processes, observer=eyes)
    train([clip], config, tmp_path / "alone", "cpu", processes=processes)
    watched, alone = (PolicyFolder(tmp_path / name).checkpoint_hash() for name in ("watched", "alone"))
    assert watched == alone
    assert eyes.rows("joint_position").shape == (4, 72, 12)
    assert [iteration for _, iteration, _ in eyes.iterations] == [1, 2, 3]
    assert [time for time, _, _ in eyes.iterations] == pytest.approx([0.4, 0.8, 1.2])
    curves = eyes.iterations[-1][2]
    assert {f"reward/{term}" for term in FAST.env.reward_names} < set(curves)
    assert 0.0 < curves["error/joint_rmse"] < 2.0
    assert 0.0 < curves["error/root_distance"] < 2.0
    # In the first steps after a reset no term is far from what a perfect robot earns, or negative.
    assert all(0.0 < curves[f"reward/{term}"] < 0.02 for term in FAST.env.reward_names)


def test_with_several_processes_the_first_worlds_are_seen(clip, small_config):
    one = ImitationVecEnv(ImitationEnvironment([clip], small_config, "cpu"))
    two = ParallelVecEnv([clip], small_config, 2)
    seen = []
    for env in (one, two):
        eyes = Eyes()
        env.on_step = WorldSampler(env, eyes, 0).step_done
        for _ in range(BLOCK):
            env.step(torch.full((env.num_envs, 12), 0.1))
        seen.append(eyes)
    two.close()
    for name in seen[0].blocks[0][1]:
        assert np.array_equal(seen[0].rows(name), seen[1].rows(name)), name
