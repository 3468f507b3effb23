from dataclasses import replace

import numpy as np
import pytest

from kine2go_warp.env.config import ResetConfig
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.robots import GO2
from kine2go_warp.robots.kinematics import foot_positions
from tests.kernels.oracle import reference_at, stacked

STILL = ResetConfig(1.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def placed(environment):
    """What the reference says of the first frame of each world, by the oracle."""
    placement = environment.episodes.placement
    return stacked(
        [
            reference_at(environment.clips[0], float(phase) * environment.clips[0].num_frames, float(heading), origin)
            for phase, heading, origin in zip(
                placement.start_phase.numpy(), placement.heading.numpy(), placement.origin.numpy(), strict=True
            )
        ]
    )


@pytest.fixture(scope="module")
def still(clip, small_config):
    return ImitationEnvironment([clip], replace(small_config, num_worlds=64, reset=STILL), "cpu", use_graph=False)


def test_without_perturbation_the_robot_starts_on_its_reference(still):
    expected = placed(still)
    joint_q, joint_qd = still.robot.joint_q.numpy(), still.robot.joint_qd.numpy()
    np.testing.assert_allclose(joint_q[:, :2], 0.0, atol=2e-6, err_msg="starts above the origin of its world")
    np.testing.assert_allclose(joint_q[:, :3], expected.position, atol=2e-3)
    assert np.max(1.0 - np.abs(np.sum(joint_q[:, 3:7] * expected.quaternion, axis=1))) < 1e-6
    np.testing.assert_allclose(joint_q[:, 7:], expected.joint, atol=1e-5)
    com = expected.rotation.apply(still.robot.com_b.numpy())
    np.testing.assert_allclose(joint_qd[:, :3], expected.linear + np.cross(expected.angular, com), atol=1e-4)
    np.testing.assert_allclose(joint_qd[:, 3:6], expected.angular, atol=1e-4)
    np.testing.assert_allclose(joint_qd[:, 6:], expected.joint_speed, atol=1e-3)


def test_phases_and_headings_are_spread_evenly(clip, small_config):
    environment = ImitationEnvironment([clip], replace(small_config, num_worlds=512), "cpu", use_graph=False)
    phase, heading = environment.episodes.placement.start_phase.numpy(), environment.episodes.placement.heading.numpy()
    assert np.all((phase >= 0.0) & (phase < 1.0))
    assert np.histogram(phase, 8, (0.0, 1.0))[0].min() > 30
    assert np.histogram(heading, 8, (-np.pi, np.pi))[0].min() > 30
    assert abs(np.corrcoef(phase, heading)[0, 1]) < 0.15


def test_no_foot_starts_below_the_floor_and_no_joint_beyond_its_limits(clip, small_config):
    wild = ResetConfig(0.8, 0.5, 5.0, 0.4, 1.0, 1.0)
    environment = ImitationEnvironment(
        [clip], replace(small_config, num_worlds=256, reset=wild), "cpu", use_graph=False
    )
    joint_q = environment.robot.joint_q.numpy().astype(float)
    from scipy.spatial.transform import Rotation

    feet = foot_positions(GO2, joint_q[:, 7:])
    rotation = Rotation.from_quat(joint_q[:, 3:7])
    height = np.stack([rotation.apply(feet[:, leg])[:, 2] for leg in range(4)], axis=1) + joint_q[:, 2:3]
    assert height.min() > GO2.foot_radius - 1e-5
    assert np.all(joint_q[:, 7:] >= np.float32(GO2.joint_lower))
    assert np.all(joint_q[:, 7:] <= np.float32(GO2.joint_upper))


def test_only_worlds_that_are_done_begin_anew(still):
    before = still.robot.joint_q.numpy().copy()
    still.episodes.done.assign(np.arange(64) % 2)
    still._reset_worlds()
    changed = np.any(still.robot.joint_q.numpy() != before, axis=1)
    np.testing.assert_array_equal(changed, np.arange(64) % 2 == 1)


def test_some_episodes_begin_standing_where_the_reference_is(clip, small_config):
    half = replace(STILL, reference_probability=0.7)
    environment = ImitationEnvironment(
        [clip], replace(small_config, num_worlds=512, reset=half), "cpu", use_graph=False
    )
    joint_q, joint_qd = environment.robot.joint_q.numpy(), environment.robot.joint_qd.numpy()
    standing = np.all(joint_q[:, 7:] == np.float32(GO2.default_joint_position), axis=1)
    assert 0.2 < standing.mean() < 0.4
    assert not joint_qd[standing].any()
    np.testing.assert_allclose(joint_q[standing, :2], 0.0, atol=2e-6)
    np.testing.assert_allclose(joint_q[standing, 3:5], 0.0, atol=1e-6, err_msg="level")
    expected = placed(environment).yaw[standing]
    yaw = 2.0 * np.arctan2(joint_q[standing, 5], joint_q[standing, 6])
    np.testing.assert_allclose(np.cos(yaw - expected), 1.0, atol=1e-5)


def test_a_new_episode_begins_without_the_forces_of_the_last(still):
    still.simulation.foot_force.fill_(7.0)
    still.episodes.done.fill_(1)
    still._reset_worlds()
    assert not still.simulation.foot_force.numpy().any()
