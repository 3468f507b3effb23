"""Noticing that a training has broken down, and what follows."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch
from rsl_rl.algorithms import PPO

from kine2go_warp.errors import TrainingDiverged
from kine2go_warp.interruption import TrainingInterrupted
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.learning.presets import FAST
from kine2go_warp.training.beginning import slower
from kine2go_warp.training.divergence import DivergenceWatch
from kine2go_warp.training.train import train
from tests.training.helpers import StopAfter, assert_same_training

TINY = FAST.override({"env.num_worlds": 16, "ppo.iterations": 4})

HEALTHY = {
    "walk": [14, 79, 116, 116, 125, 140, 156, 167, 197, 220, 242, 264, 280, 320, 422, 557, 581, 588, 585, 585, 600],
    "slow trot": [14, 37, 64, 74, 64, 69, 69, 63, 67, 68, 69, 75, 80, 82, 84, 88, 99, 106, 114, 126, 133, 139, 147, 157,
                  164, 176, 186, 198, 206, 216, 223, 214, 202, 197, 186, 181, 174, 180, 193, 206, 216, 223, 226, 240],
}  # fmt: skip
"""Mean lengths of episodes of real trainings with the preset ``fast`` and with an earlier form of it."""


def watch_lengths(lengths, watch=None):
    """Shows a curve of mean episode lengths to a watch; returns at which iteration it raises, if it does."""
    watch = watch or DivergenceWatch()
    for iteration, length in enumerate(lengths, start=1):
        try:
            watch.check(iteration, {"value": 0.1}, 1.0, float(length))
        except TrainingDiverged as error:
            return iteration, str(error)
    return None


@pytest.mark.parametrize("name", HEALTHY)
def test_a_healthy_training_is_left_alone(name):
    assert watch_lengths(HEALTHY[name]) is None


def test_a_collapse_is_noticed_after_ten_iterations():
    lengths = [*np.linspace(14, 400, 40), *[60] * 30]
    assert watch_lengths(lengths) == (
        50,
        "iteration 50: episodes have lasted 60 steps or so for 10 iterations, after 400 at best",
    )


@pytest.mark.parametrize(
    "lengths",
    [
        [*np.linspace(14, 400, 40), *[60] * 9, 120, *[60] * 9, 400],
        [*np.linspace(14, 400, 40), *[120] * 50],
        [400, *[20] * 19, 150, 200, 300],
        [float("nan")] * 40,
    ],
    ids=["short dips", "above a quarter", "during the warm-up", "no episode has ended"],
)
def test_what_is_no_collapse(lengths):
    assert watch_lengths(lengths) is None


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_numbers_that_are_not_finite_are_named(value):
    watch = DivergenceWatch()
    watch.check(1, {"value": 0.1}, float("nan"), float("nan"))
    with pytest.raises(TrainingDiverged, match=f"iteration 3: the loss 'surrogate' is {value}"):
        watch.check(3, {"value": 0.1, "surrogate": value}, 1.0, 20.0)
    with pytest.raises(TrainingDiverged, match=f"the mean reward is {value}"):
        watch.check(3, {"value": 0.1}, value, 20.0)
    model = torch.nn.Linear(3, 2)
    watch.check(3, {"value": 0.1}, 1.0, 20.0, [model])
    with torch.no_grad():
        model.weight[1, 2] = value
    with pytest.raises(TrainingDiverged, match="a weight of the networks is not finite"):
        watch.check(3, {"value": 0.1}, 1.0, 20.0, [model])


@pytest.fixture
def poison(monkeypatch):
    """Spoils a weight at chosen updates, counted from one, of all trainings that follow."""
    update, count = PPO.update, 0

    def at(*calls):
        def poisoned(self):
            nonlocal count
            count += 1
            losses = update(self)
            if count in calls:
                next(self.actor.parameters()).data[0] = float("nan")
            return losses

        monkeypatch.setattr(PPO, "update", poisoned)

    return at


def test_a_training_that_diverges_begins_again_once_and_learns_more_slowly(clip, tmp_path, poison):
    poison(3)
    folder, notes = tmp_path / "policy", []
    arguments = ([clip], TINY, folder, "cpu")
    # The second attempt is interrupted as well: a resumed training knows which attempt it is.
    with pytest.raises(TrainingInterrupted):
        train(*arguments, processes=1, on_note=notes.append, should_stop=StopAfter(4))
    record = train(*arguments, processes=1, on_note=notes.append)
    reason = "iteration 3: a weight of the networks is not finite"
    assert (record.complete, record.restarts, record.restart_reason) == (True, 1, reason)
    assert json.loads((folder / "policy.json").read_text())["restart_reason"] == reason
    assert [reason in note and "learning rate of 0.00033" in note for note in notes] == [True]
    assert [path.name for path in PolicyFolder(folder / "diverged").checkpoints()] == ["model_0.pt"]
    assert list((folder / "diverged").glob("events.out.*"))
    train([clip], replace(TINY, ppo=slower(TINY.ppo)), tmp_path / "slower", "cpu", processes=1)
    assert_same_training(folder, tmp_path / "slower")


def test_a_training_that_diverges_twice_fails_with_the_reason(clip, tmp_path, poison):
    poison(2, 3)
    with pytest.raises(TrainingDiverged, match=r"policy: training diverged, again after a restart: iteration 1: a w"):
        train([clip], TINY, tmp_path / "policy", "cpu", processes=1, on_note=str)
