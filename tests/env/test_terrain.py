from dataclasses import replace

import numpy as np
import pytest

from kine2go_warp.env.config import TerrainConfig
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.terrain import build_height_field
from kine2go_warp.errors import Kine2GoError
from tests.env.helpers import STILL

KINDS = ("waves", "steps", "slopes")


@pytest.mark.parametrize("kind", KINDS)
def test_ground_has_the_height_asked_for_and_reaches_far_enough(kind):
    ground = build_height_field(TerrainConfig(kind, height=0.1, length=1.0), reach=8.0)
    assert 0.08 < np.ptp(ground.height) <= 0.1 + 1e-6
    assert ground.half_extent >= 8.0
    assert np.ptp(ground.lift) <= np.ptp(ground.height)
    assert np.abs(np.diff(ground.lift, axis=1)).max() < np.abs(np.diff(ground.height, axis=1)).max() + 1e-6


def test_slopes_rise_evenly():
    ground = build_height_field(TerrainConfig("slopes", height=0.2, length=4.0), reach=8.0)
    slope = np.abs(np.diff(ground.height, axis=1)) / 0.1
    # Half a length for the whole height; the cells across a crest are flatter.
    np.testing.assert_allclose(np.median(slope), 0.2 / 2.0, rtol=1e-3)


@pytest.mark.parametrize("kind", KINDS)
def test_robots_begin_and_stay_on_top_of_the_ground(kind, clip, small_config):
    config = replace(small_config, num_worlds=32, terrain=TerrainConfig(kind, height=0.1), reset=STILL)
    environment = ImitationEnvironment([clip], config, "cpu")
    heights = environment.robot.joint_q.numpy()[:, 2]
    assert np.ptp(heights) > 0.03, "the reference is lifted onto uneven ground"
    assert np.ptp(environment.robot.joint_q.numpy()[:, 0]) > 5.0, "episodes begin in different places"
    touched = np.zeros(32, bool)
    for _ in range(20):
        environment.step()
        touched |= environment.simulation.foot_force.numpy()[..., 2].max(axis=1) > 20.0
    assert touched.all(), "every robot stands on the height field"
    assert not np.isin(environment.episodes.reason.numpy(), (4, 6)).any()
    error = environment.robot.joint_q.numpy()[:, 2] - environment.reference.root.numpy()[:, 2]
    assert np.abs(error).max() < 0.15


def test_the_reference_follows_the_ground_and_its_velocity_agrees(clip, small_config):
    config = replace(small_config, num_worlds=32, terrain=TerrainConfig("waves", height=0.3, length=3.0), reset=STILL)
    environment = ImitationEnvironment([clip], config, "cpu", use_graph=False)
    places, speeds = [], []
    for step in range(30):
        environment.episodes.reference_step.fill_(step)
        environment._evaluate()
        places.append(environment.reference.root.numpy()[:, :3].copy())
        speeds.append(environment.reference.linear_velocity.numpy().copy())
    places, speeds = np.array(places, np.float64), np.array(speeds, np.float64)
    level = ImitationEnvironment([clip], replace(config, terrain=TerrainConfig()), "cpu", use_graph=False)
    for step in range(30):
        level.episodes.reference_step.fill_(step)
        level._evaluate()
        speeds[step, :, 2] -= level.reference.linear_velocity.numpy()[:, 2]
        places[step, :, 2] -= level.reference.root.numpy()[:, 2]
    climb = (places[2:, :, 2] - places[:-2, :, 2]) * 0.5 * config.control_rate
    assert np.abs(climb).max() > 0.05, "the ground must be uneven"
    np.testing.assert_allclose(speeds[1:-1, :, 2], climb, atol=0.02)


def test_impossible_ground_is_refused():
    with pytest.raises(Kine2GoError, match="positive"):
        TerrainConfig("waves", height=0.0)
