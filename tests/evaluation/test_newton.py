"""Rollouts from chosen initial states."""

import numpy as np
import pytest
import warp as wp

from kine2go_warp.deployment.reference import PlacedClip
from kine2go_warp.evaluation.config import RANDOMIZATIONS, EvalConfig
from kine2go_warp.evaluation.metrics import measure
from kine2go_warp.evaluation.newton import NewtonRollouts
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.robots import GO2

SMALL = EvalConfig(worlds=4, seconds=0.5)


@pytest.fixture(scope="module")
def rollouts(policy: PolicyFolder):
    record = policy.read_record()
    with NewtonRollouts(policy, record, policy.read_clips(record), SMALL, (0.0, 1.0), False, "cpu") as newton:
        yield newton


def test_phases_are_spread_over_the_cycle_and_headings_all_round(clip):
    config = EvalConfig(worlds=64)
    np.testing.assert_allclose(np.diff(config.initial_phases(clip)), 1.0 / 64.0, atol=1e-6)
    assert config.initial_phases(clip)[0] == pytest.approx(0.5 / 64.0)
    quarters = np.floor((config.initial_headings() + np.pi) / (0.5 * np.pi))
    np.testing.assert_allclose(np.bincount(quarters.astype(int)), 16, atol=1)
    assert abs(np.corrcoef(config.initial_phases(clip), np.cos(config.initial_headings()))[0, 1]) < 0.1


def test_rollouts_of_a_clip_played_once_begin_at_its_first_frame_and_end_at_its_last(clip, once_clip):
    config = EvalConfig(worlds=5)
    assert not config.initial_phases(once_clip).any()
    assert config.rows(60.0, once_clip) == once_clip.num_frames
    assert config.rows(50.0, once_clip) == np.ceil((once_clip.num_frames - 1) * 50.0 / 60.0) + 1
    assert config.rows(60.0, clip) == 1200
    assert EvalConfig(seconds=0.5).rows(60.0, once_clip) == 30


def test_every_rollout_begins_on_the_reference_at_its_phase_and_heading(rollouts, clip):
    recorded = rollouts.run(0)
    rows = recorded.rows(np.arange(8))
    np.testing.assert_allclose(rows["phase"][:, 0], np.tile(SMALL.initial_phases(clip), 2), atol=1e-6)
    for index, (phase, heading) in enumerate(zip(recorded.initial.phase, recorded.initial.heading, strict=True)):
        placed = PlacedClip(clip, 60.0)
        placed.place(float(phase), (0.0, 0.0), float(heading))
        np.testing.assert_allclose(rows["reference_root_position"][index, 0], placed.root(0.0).position, atol=1e-5)
        np.testing.assert_allclose(rows["reference_root_position"][index, 29], placed.root(29.0).position, atol=1e-5)
        np.testing.assert_allclose(rows["root_position"][index, 0, :2], (0.0, 0.0), atol=1e-5)
        perturbed = rows["joint_position"][index, 0] - placed.joint_position(0.0)
        assert 0.0 < np.abs(perturbed).max() <= 0.0501
        np.testing.assert_allclose(recorded.initial.joint_q[index, 7:], rows["joint_position"][index, 0])


def test_noise_is_what_the_two_halves_differ_by(rollouts):
    rows = rollouts.run(0).rows(np.arange(8))
    off = np.abs(rows["action"] - rows["action_mean"]).max(axis=(1, 2))
    assert off[:4].max() < 1e-6
    assert off[4:].min() > 0.5


def test_the_same_rollouts_come_out_again(rollouts):
    one, other = (rollouts.run(0).rows(np.arange(8)) for _ in range(2))
    for name, values in one.items():
        np.testing.assert_array_equal(values, other[name], name)


def test_later_episodes_are_drawn_as_ever(rollouts, clip):
    environment = rollouts.environment
    rollouts.run(0)
    environment.episodes.done.fill_(1)
    with wp.ScopedDevice("cpu"):
        environment._reset_worlds()
    assert not np.isin(environment.episodes.placement.start_phase.numpy(), SMALL.initial_phases(clip)).any()


def test_metrics_are_computed_from_the_rows_before_the_end(policy, clip):
    record = policy.read_record()
    config = EvalConfig(worlds=4, seconds=1.0, max_distance=0.03)
    with NewtonRollouts(policy, record, (clip,), config, (1.0,), False, "cpu") as newton:
        recorded = newton.run(0)
        result = measure(recorded, np.arange(4), clip.name, "", 1.0 / 60.0, GO2)
        rows = recorded.rows(np.arange(4))
    assert result.reasons == {"distance": 4}
    assert result.survival.value == 0.0
    assert (recorded.length < 60).all()
    for index, length in enumerate(recorded.length):
        distance = np.linalg.norm(rows["root_position"] - rows["reference_root_position"], axis=-1)[index]
        assert distance[:length].max() <= 0.03
        assert np.isnan(distance[length:]).all()
        assert result.metrics["root_error"][index] == pytest.approx(distance[:length].mean(), rel=1e-5)
        joint = (rows["joint_position"] - rows["reference_joint_position"])[index, :length]
        assert result.metrics["joint_rmse"][index] == pytest.approx(np.sqrt((joint**2).mean()), rel=1e-5)
    assert not result.meets_thresholds


def test_randomised_worlds_differ_and_robots_are_pushed(policy, clip):
    record = policy.read_record()
    config = EvalConfig(worlds=6, seconds=6.0, max_distance=9.0, randomization="robust")
    assert config.environment(record.preset.env, True, 6).randomization == RANDOMIZATIONS["robust"]
    with NewtonRollouts(policy, record, (clip,), config, (0.0,), True, "cpu") as newton:
        drawn = newton.environment.randomization.parameters()
        push = newton.run(0).rows(np.arange(6))["push"]
    assert np.ptp(drawn["base_mass"]) > 0.1
    assert np.ptp(drawn["stiffness"]) > 1.0
    assert (np.nan_to_num(push) != 0.0).any()
