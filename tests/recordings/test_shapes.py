import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kine2go_warp.recordings.shapes import about, compute_poses, skeletons
from kine2go_warp.robots import GO2
from kine2go_warp.robots.kinematics import link_positions
from kine2go_warp.rotations import rotate


@pytest.fixture
def state(rng):
    """Root positions, orientations (w, x, y, z) and joint positions of 50 rows."""
    orientation = Rotation.random(50, random_state=1).as_quat()[:, [3, 0, 1, 2]]
    return rng.normal(size=(50, 3)), orientation, rng.uniform(-1.5, 1.5, (50, 12))


def test_a_capsule_that_begins_at_its_lower_end_leads_to_the_joint_above(state):
    poses = compute_poses(GO2, *state)
    down = np.array([0.0, 0.0, -1.0])
    lengths = np.array([leg.calf_length for leg in GO2.legs])[:, None]
    np.testing.assert_allclose(poses.joint_centres(2) + rotate(poses.calf, down) * lengths, poses.feet, atol=1e-6)
    lengths = np.array([leg.thigh_length for leg in GO2.legs])[:, None]
    np.testing.assert_allclose(
        poses.joint_centres(1) + rotate(poses.thigh, down) * lengths, poses.joint_centres(2), atol=1e-6
    )


def test_links_are_where_scipy_and_the_kinematics_put_them(state):
    position, orientation, joints = state
    poses = compute_poses(GO2, *state)
    turn = Rotation.from_quat(orientation[:, [1, 2, 3, 0]])
    for link in range(16):
        expected = position + turn.apply(link_positions(GO2, joints)[:, link])
        np.testing.assert_allclose(poses.link_position[:, link], expected, atol=1e-6)


def test_stored_links_are_drawn_where_the_dataset_has_them(state, rng):
    stored = rng.normal(size=(50, 16, 3)).astype(np.float32)
    assert np.array_equal(compute_poses(GO2, *state, stored).link_position, stored)


def test_turns_agree_with_scipy(rng):
    vector = rng.normal(size=(20, 3))
    angle = rng.uniform(-3, 3, 20)
    np.testing.assert_allclose(rotate(about(1, angle), vector), Rotation.from_euler("y", angle[:, None]).apply(vector))


def test_skeletons_run_from_hip_to_foot(state):
    poses = compute_poses(GO2, *state)
    lines = skeletons(poses)
    assert lines.shape == (50, 4, 4, 3)
    np.testing.assert_array_equal(lines[:, :, 0], poses.joint_centres(0))
    np.testing.assert_array_equal(lines[:, :, 3], poses.feet)
