"""When a training stops, and which policy it keeps."""

from dataclasses import asdict, replace

import pytest
import torch

from kine2go_warp.errors import Kine2GoError
from kine2go_warp.learning.presets import FAST, PAPER
from kine2go_warp.learning.stopping import (
    ClipEvaluation,
    Evaluation,
    StoppingConfig,
    TargetWatch,
    TrackingMetrics,
    stored_evaluation,
)

CONFIG = StoppingConfig(interval=20)
GOOD = TrackingMetrics(survival=1.0, acceptance=1.0, joint_rmse=0.02, root_error=0.02, foot_slip=0.1)


def evaluation(iteration, phases=GOOD, first_frame=GOOD):
    return Evaluation(iteration, {"trot": ClipEvaluation(phases, first_frame)})


def evaluation_of_clips(iteration, *clips):
    return Evaluation(iteration, {f"clip {number}": ClipEvaluation(one, one) for number, one in enumerate(clips)})


def model(value):
    """An actor that is recognised by its bias."""
    made = torch.nn.Linear(1, 1)
    with torch.no_grad():
        made.bias.fill_(value)
    return made


@pytest.mark.parametrize(
    "worse",
    [
        {"acceptance": 0.9},
        {"survival": 0.9, "acceptance": 0.9},
        {"joint_rmse": 0.031},
        {"root_error": 0.041},
        {"joint_rmse": float("nan")},
    ],
    ids=", ".join,
)
def test_each_target_must_be_met_from_phases_and_from_the_first_frame(worse):
    assert evaluation(20).meets(CONFIG)
    assert not evaluation(20, phases=replace(GOOD, **worse)).meets(CONFIG)
    assert not evaluation(20, first_frame=replace(GOOD, **worse)).meets(CONFIG)


def test_it_stops_when_the_targets_are_met_twice_in_a_row():
    watch, bad = TargetWatch(CONFIG), replace(GOOD, root_error=0.1)
    stops = []
    for number, metrics in enumerate([GOOD, bad, GOOD, GOOD]):
        watch.look(evaluation(20 * (number + 1), metrics), model(number))
        stops.append(watch.is_reached)
    assert stops == [False, False, False, True]


def test_the_best_policy_is_kept_and_not_the_last():
    watch = TargetWatch(CONFIG)
    for number, error in enumerate([0.2, 0.06, 0.09]):
        watch.look(evaluation(20 * (number + 1), replace(GOOD, root_error=error)), model(number))
    assert watch.kept == watch.best
    assert watch.kept.iteration == 40
    assert watch.policy_weights()["policy_state_dict"]["bias"].item() == 1.0


def test_a_policy_whose_rollouts_the_filter_rejects_is_no_better_for_its_small_errors():
    watch = TargetWatch(CONFIG)
    watch.look(evaluation(20, replace(GOOD, root_error=0.1)), model(1))
    watch.look(evaluation(40, replace(GOOD, acceptance=0.0, root_error=0.01)), model(2))
    assert watch.kept.iteration == 20


def test_of_policies_within_all_targets_the_latest_is_kept():
    watch = TargetWatch(CONFIG)
    watch.look(evaluation(20, replace(GOOD, root_error=0.01)), model(1))
    watch.look(evaluation(40, replace(GOOD, root_error=0.02)), model(2))
    watch.look(evaluation(60, replace(GOOD, root_error=0.2)), model(3))
    assert watch.kept.iteration == 40


def test_weights_that_change_afterwards_do_not_change_those_that_are_kept():
    watch, actor = TargetWatch(CONFIG), model(1.0)
    watch.look(evaluation(20), actor)
    with torch.no_grad():
        actor.bias.fill_(5.0)
    assert watch.best_weights["bias"].item() == 1.0


def test_the_end_of_the_budget_between_two_intervals_changes_nothing_for_a_longer_training():
    watch = TargetWatch(CONFIG)
    watch.look(evaluation(20, replace(GOOD, root_error=0.06)), model(1))
    before = watch.state()
    watch.look(evaluation(30, replace(GOOD, root_error=0.05)), model(2))
    assert watch.state() == before
    assert watch.kept.iteration == 30
    assert watch.policy_weights() == {}, "the last weights act"
    longer = TargetWatch(CONFIG)
    longer.restore(watch.state())
    assert longer.kept.iteration == 20


def test_the_state_is_restored_as_it_was():
    watch, other = TargetWatch(CONFIG), TargetWatch(CONFIG)
    watch.look(evaluation(20), model(1))
    other.restore(watch.state())
    assert (other.met, other.latest, other.best) == (1, evaluation(20), evaluation(20))
    assert stored_evaluation(asdict(evaluation(20))) == evaluation(20)
    assert stored_evaluation(None) is None


def test_an_evaluation_of_before_clips_were_told_apart_is_read():
    stored = {"iteration": 20, "phases": asdict(GOOD), "first_frame": asdict(GOOD), "rejected": ""}
    assert stored_evaluation(stored).phases == GOOD
    assert stored_evaluation(stored).rank(CONFIG) == evaluation(20).rank(CONFIG)


def test_every_clip_must_meet_the_targets_and_the_worst_is_shown():
    other = TrackingMetrics(survival=0.5, acceptance=0.25, joint_rmse=0.01, root_error=0.3, foot_slip=0.05)
    both = evaluation_of_clips(20, GOOD, other)
    assert both.phases == TrackingMetrics(0.5, 0.25, 0.02, 0.3, 0.1)
    assert not both.meets(CONFIG)
    assert evaluation_of_clips(20, GOOD, GOOD).meets(CONFIG)
    assert str(both) == "1 of 2 clips survive in every rollout, mean survival 75 %, mean acceptance 62 %"


def test_of_many_clips_the_policy_that_tracks_more_is_kept_although_one_is_always_lost():
    lost = replace(GOOD, survival=0.0, acceptance=0.0, joint_rmse=float("nan"))
    watch = TargetWatch(CONFIG)
    watch.look(evaluation_of_clips(20, GOOD, GOOD, lost), model(1))
    watch.look(evaluation_of_clips(40, GOOD, lost, lost), model(2))
    assert watch.kept.iteration == 20


def test_presets_that_stop_early_and_the_paper_that_does_not():
    assert FAST.stopping.is_active(FAST.ppo.iterations)
    assert not PAPER.stopping.is_active(PAPER.ppo.iterations)
    assert not FAST.override({"stopping.interval": 0}).stopping.is_active(600)
    assert not FAST.stopping.is_active(FAST.stopping.interval - 1), "a training that ends before the first evaluation"


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"interval": -1}, "interval is -1; it must be from 0"),
        ({"min_acceptance": 1.5}, "min_acceptance is 1.5; it must be from 0 to 1"),
        ({"max_root_error": 0.0}, "max_root_error is 0.0; it must be positive"),
        ({"rollouts": 1}, "rollouts is 1; it must be from 2"),
    ],
)
def test_values_out_of_range_are_refused(values, message):
    with pytest.raises(Kine2GoError, match=message):
        StoppingConfig(**values)
