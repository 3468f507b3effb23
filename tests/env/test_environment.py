from dataclasses import replace

import numpy as np
import pytest
import warp as wp

from kine2go_warp.env.config import EnvConfig, MotorConfig, ResetConfig, TerminationConfig
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.observations import observation_layout, observation_size
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.kernels.rewards import MAXIMUM_REWARDS
from kine2go_warp.motions.clip import assemble_clip
from kine2go_warp.motions.cycle import CycleStep
from kine2go_warp.robots import GO2

STILL = ResetConfig(1.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def standing_clip(clip):
    """A clip of the robot standing in its default pose."""
    frames = 10
    return assemble_clip(
        "standing",
        1.0 / 60.0,
        np.tile([0.0, 0.0, GO2.default_root_height], (frames, 1)),
        np.tile([1.0, 0.0, 0.0, 0.0], (frames, 1)),
        np.tile(GO2.default_joint_position, (frames, 1)),
        np.ones((frames, 4)),
        np.zeros(frames),
        CycleStep(0.0, 0.0, 0.0),
        clip.origin,
        GO2,
    )


def snapshot(environment):
    episodes = environment.episodes
    arrays = {
        "observation": environment.observation,
        "reward_terms": environment.reward_terms,
        "reward": environment.reward,
        "done": episodes.done,
        "time_out": episodes.time_out,
        "reason": episodes.reason,
        "foot_force": environment.simulation.foot_force,
        "torque": environment.motors.torque,
        "joint_q": environment.robot.joint_q,
    }
    return {name: array.numpy().copy() for name, array in arrays.items()}


def drive(environment, steps, seed):
    """Steps with the same random outputs for everyone; returns what was seen."""
    rng = np.random.default_rng(seed)
    seen = []
    for _ in range(steps):
        environment.output.assign(np.float32(rng.normal(0.0, 1.0, (environment.num_worlds, 12))))
        environment.step()
        seen.append(snapshot(environment))
    return seen


def assert_same_bits(one, other):
    for step, (a, b) in enumerate(zip(one, other, strict=True)):
        for name, value in a.items():
            assert value.tobytes() == b[name].tobytes(), f"{name} differs at step {step}"


def test_the_captured_graph_equals_eager_execution_bit_for_bit_with_resets(clip, small_config):
    config = replace(small_config, episode_time=0.5)
    graph = drive(ImitationEnvironment([clip], config, "cpu"), 60, 1)
    eager_environment = ImitationEnvironment([clip], config, "cpu", use_graph=False)
    assert sum(step["done"].sum() for step in graph) >= config.num_worlds, "there must be resets"
    assert_same_bits(graph, drive(eager_environment, 60, 1))


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
    expected = np.array(MAXIMUM_REWARDS) * config.reward.weights / config.control_rate
    # Where the first frames dip below the floor the robot is lifted onto it, by a hair for this clip.
    np.testing.assert_allclose(environment.reward_terms.numpy(), np.tile(expected, (64, 1)), rtol=1e-3)


def test_a_standing_robots_feet_bear_its_weight(standing_clip, small_config):
    config = replace(small_config, reset=STILL, motor=MotorConfig(60.0, 2.0))
    environment = ImitationEnvironment([standing_clip], config, "cpu")
    for _ in range(120):
        environment.step()
    force = environment.simulation.foot_force.numpy()
    weight = environment.simulation.model.body_mass.numpy().sum() / config.num_worlds * 9.81
    np.testing.assert_allclose(force[..., 2].sum(axis=1), weight, rtol=0.01)
    assert force[..., 2].min() > 0.1 * weight, "every foot stands"
    np.testing.assert_allclose(force[..., :2].sum(axis=1), 0.0, atol=0.02 * weight)
    tangential = np.linalg.norm(force[..., :2], axis=-1)
    # A pyramid's corners reach beyond the cone that it stands for, by a factor of sqrt(2) at most.
    assert np.all(tangential <= np.sqrt(2.0) * config.solver.friction * force[..., 2] + 1e-3)
    assert not environment.simulation.body_contact.numpy().any()


def test_torques_never_exceed_the_motors_limits(clip, small_config):
    environment = ImitationEnvironment([clip], replace(small_config, motor=MotorConfig(500.0, 2.0)), "cpu")
    torque = np.stack([step["torque"] for step in drive(environment, 20, 3)])
    assert np.all(np.abs(torque) <= np.float32(GO2.joint_effort))
    assert np.any(np.abs(torque) == np.float32(GO2.joint_effort)), "the test must reach them"


def test_a_limp_robot_falls_and_begins_anew(standing_clip, small_config):
    config = replace(small_config, motor=MotorConfig(1e-3, 0.1), termination=TerminationConfig(10.0, 10.0), reset=STILL)
    environment = ImitationEnvironment([standing_clip], config, "cpu")
    names = set()
    for _ in range(90):
        environment.step()
        names |= set(environment.episodes.reason.numpy().tolist())
    assert 3 in names, "the base touches the floor"


def test_time_outs_end_episodes_that_go_well(standing_clip, small_config):
    config = replace(small_config, episode_time=0.25, reset=STILL)
    environment = ImitationEnvironment([standing_clip], config, "cpu")
    flags = []
    for _ in range(16):
        environment.step()
        flags.append(environment.episodes.time_out.numpy().copy())
    assert np.array_equal(np.argmax(flags, axis=0), np.full(config.num_worlds, 14)), "0.25 s are 15 steps"


def test_several_clips_share_an_environment(clip, standing_clip, small_config):
    config = replace(small_config, num_worlds=64, reset=STILL)
    environment = ImitationEnvironment([clip, standing_clip], config, "cpu", use_graph=False)
    which = environment.episodes.placement.clip.numpy()
    assert set(which) == {0, 1}
    height = environment.robot.joint_q.numpy()[which == 1, 2]
    np.testing.assert_allclose(height, GO2.default_root_height, atol=1e-6)


def test_a_step_allocates_nothing_on_the_device(environment):
    environment.step()
    arrays = {name: value.ptr for name, value in vars(environment).items() if isinstance(value, wp.array)}
    for _ in range(3):
        environment.step()
    assert arrays == {name: value.ptr for name, value in vars(environment).items() if isinstance(value, wp.array)}


def test_the_layout_names_every_value_once():
    config = EnvConfig()
    layout = observation_layout(config)
    assert [field.start for field in layout[1:]] == [field.stop for field in layout[:-1]]
    assert layout[-1].stop == observation_size(config) == 3 * 45 + 4 * 21
    assert len({field.name for field in layout}) == len(layout)


def test_the_paper_is_the_default():
    config = EnvConfig()
    scales = np.array(config.reward.weights) / config.control_rate
    np.testing.assert_allclose(scales, [0.008333, 0.000833, 0.003333, 0.0025, 0.001667], atol=1e-6)
    assert (config.num_worlds, config.episode_time, config.control_rate, config.substeps) == (8192, 20.0, 60.0, 4)
    assert (config.action.scale, config.action.clip, config.action.latency) == (0.25, 100.0, 0.02)
    assert (config.history_length, config.steps_ahead) == (3, (1, 2, 10, 30))
    assert (config.termination.max_distance, config.termination.max_angle) == (1.0, 1.5708)
    assert config.delay_substeps == 5


@pytest.mark.parametrize("changes", [{"substeps": 3}, {"num_worlds": 0}, {"control_rate": -1.0}])
def test_impossible_settings_are_refused(changes):
    with pytest.raises(Kine2GoError):
        EnvConfig(**changes)
