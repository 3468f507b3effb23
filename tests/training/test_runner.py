"""What the training tells of its episodes."""

import torch
from rsl_rl.utils.logger import Logger

from kine2go_warp.training.logger import QuietLogger
from kine2go_warp.training.runner import tensor_cores
from tests.waiting import no_waits


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
            log = {"log": {"tracking": rewards.mean()}}
            theirs.process_env_step(rewards, dones, log)
            with no_waits():
                ours.process_env_step(rewards, dones, log)
        ours.read_episodes()
        assert list(ours.rewbuffer) == list(theirs.rewbuffer)
        assert list(ours.lenbuffer) == list(theirs.lenbuffer)
        assert torch.equal(ours.cur_reward_sum, theirs.cur_reward_sum)
        assert torch.equal(ours.cur_episode_length, theirs.cur_episode_length)
    assert len(ours.ep_extras) == len(theirs.ep_extras) == 48
    assert len(ours.rewbuffer) > 20


def test_matrix_products_are_rounded_to_tf32_while_a_gpu_learns_and_nowhere_else():
    exact = torch.get_float32_matmul_precision()
    assert exact == "highest"
    with tensor_cores("cuda:0"):
        assert torch.get_float32_matmul_precision() == "high"
    with tensor_cores("cpu"):
        assert torch.get_float32_matmul_precision() == exact
    assert torch.get_float32_matmul_precision() == exact
