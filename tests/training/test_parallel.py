import os
import signal
from dataclasses import replace

import numpy as np
import pytest
import torch

from kine2go_warp.device import choose_processes
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.errors import Kine2GoError, SimulationError
from kine2go_warp.learning.vec_env import ImitationVecEnv
from kine2go_warp.training.parallel import ParallelVecEnv


def test_two_processes_give_the_same_bits_as_one_and_a_dead_worker_is_reported(clip, small_config):
    config = replace(small_config, num_worlds=7, episode_time=0.3, privileged=True)
    one = ImitationVecEnv(ImitationEnvironment([clip], config, "cpu"))
    two = ParallelVecEnv([clip], config, 2)
    rng = np.random.default_rng(0)
    lengths = torch.arange(7)
    one.episode_length_buf, two.episode_length_buf = lengths, lengths.clone()
    ends = 0
    for _ in range(40):
        actions = torch.from_numpy(np.float32(rng.normal(0.0, 0.4, (7, 12))))
        one.step(actions)
        two.step(actions)
        ends += int(one.buffers.done.sum())
        for name, expected in vars(one.buffers).items():
            assert torch.equal(getattr(two.buffers, name), expected), name
    assert ends > 7
    assert two.fault_count() == one.fault_count() == 0
    # What one environment was, both become, and go on alike.
    taken = one.snapshot()
    one.step(torch.ones(7, 12))
    for env in (one, two):
        env.restore(taken)
        env.step(torch.full((7, 12), 0.3))
    for name, expected in two.snapshot().worlds.items():
        assert expected.tobytes() == one.snapshot().worlds[name].tobytes(), name
    os.kill(two.workers[0].pid or 0, signal.SIGKILL)
    two.workers[0].join()
    with pytest.raises(SimulationError, match=r"worlds 4 and up has died \(exit code -9\)"):
        two.snapshot()
    with pytest.raises(SimulationError, match="has died"):
        two.step(torch.zeros(7, 12))


@pytest.mark.parametrize(
    ("wanted", "num_worlds", "device", "chosen"),
    [(3, 256, "cpu", 3), (3, 2, "cpu", 2), (None, 31, "cpu", 1), (None, 4096, "cuda:0", 1)],
)
def test_the_number_of_processes(wanted, num_worlds, device, chosen):
    assert choose_processes(wanted, num_worlds, device) == chosen


def test_no_processes_at_all_are_refused():
    with pytest.raises(Kine2GoError, match="must be at least 1"):
        choose_processes(0, 64, "cpu")
