from dataclasses import replace

import numpy as np
import pytest

from kine2go_warp.env.config import EnvConfig, MotorConfig
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.observations import observation_layout, observation_size
from kine2go_warp.env.terms.base import with_term
from kine2go_warp.env.terms.terminations import TERMINATIONS, with_limits
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.robots import GO2
from tests.env.helpers import STILL, assert_same_bits, drive


def test_two_runs_with_one_seed_give_the_same_bits_and_another_seed_others(clip, small_config):
    one = drive(ImitationEnvironment([clip], small_config, "cpu"), 30, 1)
    assert_same_bits(one, drive(ImitationEnvironment([clip], small_config, "cpu"), 30, 1))
    other = drive(ImitationEnvironment([clip], replace(small_config, seed=2), "cpu"), 30, 1)
    assert not np.array_equal(one[-1]["joint_q"], other[-1]["joint_q"])


def test_a_robot_on_its_reference_earns_the_maximum_for_64_headings(clip, small_config):
    config = replace(small_config, num_worlds=64, reset=STILL)
    environment = ImitationEnvironment([clip], config, "cpu", use_graph=False)
    assert np.ptp(environment.episodes.placement.heading.numpy()) > 5.0
    environment._evaluate()
    expected = np.array([term.maximum * term.weight for term in config.active_rewards]) / config.control_rate
    # Where the first frames dip below the floor the robot is lifted onto it, by a hair for this clip.
    np.testing.assert_allclose(environment.reward_terms.numpy(), np.tile(expected, (64, 1)), rtol=1e-3)
    assert config.largest_reward == pytest.approx(np.sum(expected))


def test_a_limp_robot_falls_and_begins_anew(standing_clip, small_config):
    config = replace(small_config, motor=MotorConfig(1e-3, 0.1), terminations=with_limits(10.0, 10.0), reset=STILL)
    environment = ImitationEnvironment([standing_clip], config, "cpu")
    names = set()
    for _ in range(90):
        environment.step()
        names |= set(environment.episodes.reason.numpy().tolist())
    assert config.reason_names.index("body_contact") in names, "the base touches the floor"


def test_limits_tighten_while_worlds_grow_older(standing_clip, small_config):
    config = replace(small_config, motor=MotorConfig(1e-3, 0.1), terminations=with_limits(0.01, 10.0), reset=STILL)
    config = replace(config, initial_limit_scale=100.0, limit_anneal_time=0.5)
    environment = ImitationEnvironment([standing_clip], config, "cpu")
    failures = []
    for _ in range(40):
        environment.step()
        failures.append(environment.episodes.reason.numpy() == config.reason_names.index("distance"))
    assert not np.any(failures[:15]), "within half a metre of the reference nothing ends"
    assert np.all(np.any(failures[25:], axis=0)), "a limp robot sinks by a centimetre soon"


def test_time_outs_end_episodes_that_go_well(standing_clip, small_config):
    config = replace(small_config, episode_time=0.25, reset=STILL)
    environment = ImitationEnvironment([standing_clip], config, "cpu")
    flags = []
    for _ in range(16):
        environment.step()
        flags.append(environment.episodes.time_out.numpy().copy())
    assert np.array_equal(np.argmax(flags, axis=0), np.full(config.num_worlds, 14)), "0.25 s are 15 steps"


def test_a_clip_played_once_ends_by_a_time_out_after_its_end_is_held(once_clip, standing_clip, small_config):
    loose = with_limits(9.0, 9.0, tuple(replace(one, enabled=one.name != "body_contact") for one in TERMINATIONS[2:]))
    config = replace(small_config, num_worlds=32, reset=STILL, terminations=(*TERMINATIONS[:2], *loose), end_hold=0.1)
    environment = ImitationEnvironment([once_clip, standing_clip], config, "cpu")
    which, phase = (
        values.numpy().copy()
        for values in (environment.episodes.placement.clip, environment.episodes.placement.start_phase)
    )
    assert set(which) == {0, 1}
    ends = np.full(32, -1)
    for step in range(1, once_clip.num_frames + 8):
        environment.step()
        ended = environment.episodes.done.numpy() > 0
        assert np.array_equal(ended, environment.episodes.time_out.numpy()), "no end is a failure"
        ends[ended & (ends < 0)] = step
    assert np.all(ends[which == 1] == -1), "a cycle goes on"
    passed = (1.0 - phase) * (once_clip.num_frames - 1) + 0.1 * config.control_rate
    np.testing.assert_allclose(ends[which == 0], np.ceil(passed[which == 0] - 1e-3), atol=0.01)


def test_several_clips_share_an_environment(clip, standing_clip, small_config):
    config = replace(small_config, num_worlds=64, reset=STILL)
    environment = ImitationEnvironment([clip, standing_clip], config, "cpu", use_graph=False)
    which = environment.episodes.placement.clip.numpy()
    assert set(which) == {0, 1}
    height = environment.robot.joint_q.numpy()[which == 1, 2]
    np.testing.assert_allclose(height, GO2.default_root_height, atol=1e-6)


def test_the_layout_names_every_value_once():
    config = EnvConfig()
    layout = observation_layout(config)
    assert [field.start for field in layout[1:]] == [field.stop for field in layout[:-1]]
    assert layout[-1].stop == observation_size(config) == 3 * 45 + 4 * 21
    assert len({field.name for field in layout}) == len(layout)


def test_the_paper_is_the_default():
    config = EnvConfig()
    scales = np.array([term.weight for term in config.active_rewards]) / config.control_rate
    np.testing.assert_allclose(scales, [0.008333, 0.000833, 0.003333, 0.0025, 0.001667], atol=1e-6)
    assert (config.num_worlds, config.episode_time, config.control_rate, config.substeps) == (8192, 20.0, 60.0, 4)
    assert (config.action.scale, config.action.clip, config.action.latency) == (0.25, 100.0, 0.02)
    assert (config.history_length, config.steps_ahead) == (3, (1, 2, 10, 30))
    limits = {name: value for term in config.terminations for name, value in term.params}
    assert limits == {"max_distance": 1.0, "max_angle": 1.5708}
    assert config.delay_substeps == 5


@pytest.mark.parametrize("changes", [{"substeps": 0}, {"num_worlds": -1}, {"control_rate": -1.0}])
def test_impossible_settings_are_refused(changes):
    with pytest.raises(Kine2GoError):
        EnvConfig(**changes)


def test_a_change_of_the_action_costs_what_is_asked_and_the_terms_add_up_to_the_reward(clip, small_config, rng):
    actions = np.float32(rng.normal(0.0, 0.3, (3, small_config.num_worlds, 12)))
    found = []
    for weight in (0.0, -0.02):
        config = replace(small_config, rewards=with_term(small_config.rewards, "action_rate", weight=weight))
        environment = ImitationEnvironment([clip], config, "cpu")
        for action in actions:
            environment.action.assign(action)
            environment.step()
        assert not environment.episodes.done.numpy().any()
        found.append((environment.reward.numpy().copy(), environment.reward_terms.numpy().copy()))
    cost = 0.02 / config.control_rate * np.sum((actions[2] - actions[1]) ** 2, axis=1)
    np.testing.assert_allclose(found[0][0] - found[1][0], cost, rtol=1e-3)
    np.testing.assert_array_equal(found[0][1], found[1][1][:, :5])
    for reward, terms in found:
        np.testing.assert_allclose(terms.sum(axis=1), reward, rtol=1e-5)


def test_the_exponent_of_a_reward_is_a_setting(clip, small_config):
    values = []
    for exponent in (5.0, 10.0):
        config = replace(small_config, rewards=with_term(small_config.rewards, "joint_position", exponent=exponent))
        environment = ImitationEnvironment([clip], config, "cpu")
        environment.step()
        values.append(environment.reward_terms.numpy()[:, 0] * config.control_rate / 0.5)
    # exp(-10 x) is the square of exp(-5 x).
    np.testing.assert_allclose(values[1], values[0] ** 2, rtol=1e-4)
    assert values[0].max() < 0.99


def test_the_velocity_is_fed_forward_by_the_ratio_of_the_gains_or_not_at_all(clip, small_config):
    targets = {}
    for mode in ("residual_ff", "residual"):
        config = replace(small_config, action=replace(small_config.action, mode=mode, latency=0.0), reset=STILL)
        environment = ImitationEnvironment([clip], config, "cpu")
        environment.step()
        targets[mode] = environment.motors.joint_target.numpy().copy()
        reference, step = environment.reference, environment.reference.joint_velocity.numpy().copy()
    # After the step the reference is sampled where the targets, without latency, were taken from.
    np.testing.assert_allclose(targets["residual"], reference.joint_position.numpy(), atol=1e-5)
    lead = config.motor.damping / config.motor.stiffness
    np.testing.assert_allclose(targets["residual_ff"] - targets["residual"], lead * step, atol=1e-5)
    assert np.abs(step).max() > 1.0
