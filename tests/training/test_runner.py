"""What the training tells of its episodes."""

import torch
from rsl_rl.utils.logger import Logger

from kine2go_warp.training.runner import QuietLogger


def logger(kind, folder):
    one = Logger(str(folder), {"num_steps_per_env": 8, "algorithm": {"rnd_cfg": None}}, {}, 5, False, 1, 0, "cpu")
    one.__class__ = kind
    one.steps, one.writer = [], object()
    return one


def test_episodes_are_those_that_rsl_rl_counts_without_reading_at_every_step(tmp_path):
    generator = torch.Generator().manual_seed(0)
    theirs, ours = logger(Logger, tmp_path), logger(QuietLogger, tmp_path)
    for _ in range(6):
        for _ in range(8):
            rewards = torch.rand(5, generator=generator)
            dones = (torch.rand(5, generator=generator) < 0.3).long()
            for one in (theirs, ours):
                one.process_env_step(rewards, dones, {"log": {"tracking": rewards.mean()}})
        ours.read_episodes()
        assert list(ours.rewbuffer) == list(theirs.rewbuffer)
        assert list(ours.lenbuffer) == list(theirs.lenbuffer)
        assert torch.equal(ours.cur_reward_sum, theirs.cur_reward_sum)
        assert torch.equal(ours.cur_episode_length, theirs.cur_episode_length)
    assert len(ours.ep_extras) == len(theirs.ep_extras) == 48
    assert len(ours.rewbuffer) > 20
