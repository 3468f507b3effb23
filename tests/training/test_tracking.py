"""Evaluations while a policy learns: they repeat, disturb nothing, decide the same after an interruption."""

from dataclasses import replace

import pytest
import torch
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from kine2go_warp.interruption import TrainingInterrupted
from kine2go_warp.learning.checkpoint import load_checkpoint
from kine2go_warp.learning.inference import NoisyPolicy
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.learning.presets import FAST
from kine2go_warp.learning.stopping import BUDGET, TARGETS
from kine2go_warp.learning.vec_env import ImitationVecEnv
from kine2go_warp.training.tracking import TrackingEvaluator
from kine2go_warp.training.train import train
from tests.training.helpers import StopAfter, assert_same_training, flattened

EVALUATED = FAST.override(
    {
        "env.num_worlds": 16,
        "ppo.iterations": 5,
        "stopping.interval": 2,
        "stopping.rollouts": 6,
        "stopping.seconds": 0.25,
    }
)
EASY = EVALUATED.override(
    {"stopping.min_acceptance": 0.0, "stopping.max_joint_rmse": 10.0, "stopping.max_root_error": 10.0}
)
"""Whose targets every policy meets, so that it stops at the second evaluation, after four iterations."""


@pytest.fixture(scope="module")
def easy(clip, tmp_path_factory):
    """A training that meets its targets, and what it reported."""
    folder, seen = tmp_path_factory.mktemp("easy") / "policy", []
    record = train([clip], EASY, folder, "cpu", processes=1, on_progress=seen.append)
    return folder, record, seen


def test_a_training_that_meets_its_targets_stops_and_says_so(easy):
    folder, record, seen = easy
    assert (record.iterations, record.stop_reason, record.complete) == (4, TARGETS, True)
    assert PolicyFolder(folder).read_record() == record
    assert [state.evaluation and state.evaluation.iteration for state in seen] == [None, 2, 2, 4]
    assert "evaluated at 4: " in str(seen[-1])
    log = EventAccumulator(str(folder)).Reload()
    found = log.Scalars("evaluation/joint_rmse")
    assert [event.step for event in found] == [1, 3]
    assert found[-1].value == pytest.approx(seen[-1].evaluation.phases.joint_rmse)


def test_asked_again_it_has_nothing_to_do(clip, easy):
    folder, *_ = easy
    before = (folder / "model_3.pt").read_bytes()
    assert train([clip], EASY.override({"ppo.iterations": 8}), folder, "cpu", processes=1).iterations == 4
    assert (folder / "model_3.pt").read_bytes() == before


@pytest.mark.parametrize("stop", [1, pytest.param(3, marks=pytest.mark.slow)])
def test_an_interrupted_training_ends_with_the_same_bits_and_the_same_decision(clip, tmp_path, easy, stop):
    """Also if the last evaluation was before the interruption, and by another number of processes."""
    folder, record, _ = easy
    with pytest.raises(TrainingInterrupted):
        train([clip], EASY, tmp_path / "policy", "cpu", processes=1, should_stop=StopAfter(stop))
    again = train([clip], EASY, tmp_path / "policy", "cpu", processes=2 if stop == 3 else 1)
    assert replace(again, seconds=0.0, core_seconds=0.0) == replace(record, seconds=0.0, core_seconds=0.0)
    assert_same_training(tmp_path / "policy", folder)


def test_a_training_that_misses_its_targets_goes_on_to_its_budget_and_learns_as_if_unwatched(clip, tmp_path):
    """The last iteration is between two intervals, and is evaluated all the same."""
    watched = train([clip], EVALUATED, tmp_path / "watched", "cpu", processes=1)
    assert (watched.iterations, watched.stop_reason) == (5, BUDGET)
    alone = train([clip], EVALUATED.override({"stopping.interval": 0}), tmp_path / "alone", "cpu", processes=1)
    assert (alone.stop_reason, alone.evaluation) == (BUDGET, None)
    one, other = (
        flattened(load_checkpoint(PolicyFolder(tmp_path / name).latest_checkpoint(), "cpu"))
        for name in ("watched", "alone")
    )
    del one["/training/logger/time"], other["/training/logger/time"]
    for name, value in other.items():
        same = value.numpy().tobytes() == one[name].numpy().tobytes() if isinstance(value, torch.Tensor) else None
        assert value == one[name] if same is None else same, name
    acts_as_evaluated(clip, tmp_path / "watched", watched)


def acts_as_evaluated(clip, folder, record):
    """The weights that act give the very evaluation that the record has."""
    evaluator = TrackingEvaluator([clip], record.preset.env, record.preset.stopping, "cpu")
    env = evaluator.env
    assert isinstance(env, ImitationVecEnv)
    actor = NoisyPolicy(env, record.preset, PolicyFolder(folder).latest_checkpoint(), 0).model
    first, second = (evaluator.evaluate(actor, record.evaluation.iteration) for _ in range(2))
    assert first == second == record.evaluation


def test_rollouts_begin_at_the_first_frame_and_all_over_the_cycle_of_every_clip(clip, standing_clip):
    config = replace(EVALUATED.stopping, rollouts=16)
    evaluator = TrackingEvaluator([clip, standing_clip], replace(EVALUATED.env, num_worlds=16), config, "cpu")
    starts = evaluator.starts
    for number in range(2):
        phase = starts.phase[starts.clip == number]
        assert (phase == 0.0).sum() == 2
        assert phase[2:] == pytest.approx([1 / 12, 3 / 12, 5 / 12, 7 / 12, 9 / 12, 11 / 12])
    placed = evaluator.env.environment
    placed.restart(1, starts)
    assert placed.episodes.placement.start_phase.numpy() == pytest.approx(starts.phase)
