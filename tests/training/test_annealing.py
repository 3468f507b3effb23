"""Noise and entropy fall while a policy learns."""

import pytest

from kine2go_warp.learning.checkpoint import load_checkpoint
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.learning.presets import FAST
from kine2go_warp.training.annealing import annealed
from kine2go_warp.training.train import train


def test_a_value_falls_linearly_and_then_stays():
    assert [annealed(0.4, 0.2, iteration, 4) for iteration in (0, 1, 2, 4, 9)] == pytest.approx(
        [0.4, 0.35, 0.3, 0.2, 0.2]
    )


def test_noise_stays_below_its_limit(clip, tmp_path):
    falling = {"ppo.final_std": 0.1, "ppo.annealing_iterations": 2}
    train([clip], FAST.override({"env.num_worlds": 16, "ppo.iterations": 3, **falling}), tmp_path, "cpu", processes=1)
    weights = load_checkpoint(PolicyFolder(tmp_path).latest_checkpoint(), "cpu")["actor_state_dict"]
    # The last update may move it by as much as the optimiser moves anything.
    assert weights["distribution.std_param"].max() < 0.15 < FAST.ppo.init_std
