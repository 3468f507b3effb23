import numpy as np
import pytest

from kine2go_warp.motions.cycle import (
    CycleStep,
    PoseSequence,
    close_cycle,
    extend_cyclically,
    recentred,
    seam_weights,
    with_extrapolated_frame,
)
from kine2go_warp.rotations import from_rotation, heading, to_rotation, yaw_rotation


def walk_on_a_circle(num_frames, turn=0.8, seam=0.0):
    """T + 1 poses on a circle, with a seam of a given size in height, tilt and joints at the last frame."""
    share = np.linspace(0.0, 1.0, num_frames + 1)
    yaw = turn * share
    radius = 2.0
    position = np.stack([radius * np.sin(yaw), radius * (1.0 - np.cos(yaw)), 0.3 + seam * share], axis=1)
    tilt = np.stack([0.1 + seam * share, -0.05 + 0.0 * share], axis=1)
    from scipy.spatial.transform import Rotation

    orientation = from_rotation(yaw_rotation(yaw) * Rotation.from_euler("yx", tilt))
    joints = 0.4 * np.sin(2.0 * np.pi * share[:, None] + np.arange(12)) + seam * share[:, None]
    return PoseSequence(position, orientation, joints)


def test_steps_compose_and_undo_each_other():
    step = CycleStep(0.3, -0.1, 0.7)
    position, orientation = np.array([[0.2, 0.1, 0.3]]), np.array([[1.0, 0.0, 0.0, 0.0]])
    there = step.repeated(5).apply(position, orientation)
    one_by_one = position, orientation
    for _ in range(5):
        one_by_one = step.apply(*one_by_one)
    np.testing.assert_allclose(there[0], one_by_one[0], atol=1e-12)
    back = step.repeated(-5).apply(*there)
    np.testing.assert_allclose(back[0], position, atol=1e-12)
    np.testing.assert_allclose(heading(back[1]), 0.0, atol=1e-12)


def test_a_cycle_without_a_seam_is_left_as_it_is():
    poses = recentred(walk_on_a_circle(40))
    closed, cycle = close_cycle(poses, 8)
    np.testing.assert_allclose(closed.root_position, poses.root_position[:-1], atol=1e-9)
    np.testing.assert_allclose(closed.channels, poses.channels[:-1], atol=1e-9)
    np.testing.assert_allclose([cycle.x, cycle.y], poses.root_position[-1, :2])
    assert cycle.yaw == pytest.approx(0.8)


def test_a_seam_is_closed_to_the_size_of_a_normal_step():
    poses = walk_on_a_circle(40, seam=0.2)
    closed, cycle = close_cycle(recentred(poses), 8)
    longer = extend_cyclically(closed.root_position, closed.root_orientation, closed.channels, cycle, 0, 40)
    steps = np.abs(np.diff(longer.channels, axis=0)).max(axis=1)
    assert steps[39] < 1.5 * np.median(steps), "the step across the seam"
    rises = np.abs(np.diff(longer.root_position[:, 2]))
    assert rises[39] < 0.05
    turns = (to_rotation(longer.root_orientation[1:]) * to_rotation(longer.root_orientation[:-1]).inv()).magnitude()
    assert turns[39] < 0.05


def test_the_root_does_not_pause_at_the_seam():
    poses = recentred(walk_on_a_circle(40))
    closed, cycle = close_cycle(poses, 8)
    longer = extend_cyclically(closed.root_position, closed.root_orientation, closed.channels, cycle, 0, 41)
    steps = np.linalg.norm(np.diff(longer.root_position[:, :2], axis=0), axis=1)
    np.testing.assert_allclose(steps, steps[0], rtol=1e-6)


def test_recentring_starts_at_the_origin_with_heading_zero():
    poses = walk_on_a_circle(10)
    turned = yaw_rotation(2.0)
    moved = PoseSequence(
        turned.apply(poses.root_position) + np.array([5.0, 1.0, 0.0]),
        from_rotation(turned * to_rotation(poses.root_orientation)),
        poses.channels,
    )
    back = recentred(moved)
    np.testing.assert_allclose(back.root_position, recentred(poses).root_position, atol=1e-9)
    np.testing.assert_allclose(back.root_position[0, :2], 0.0, atol=1e-12)
    assert heading(back.root_orientation)[0] == pytest.approx(0.0, abs=1e-12)


def test_an_extrapolated_frame_goes_on_at_the_last_velocity():
    poses = walk_on_a_circle(40)
    shorter = PoseSequence(poses.root_position[:-1], poses.root_orientation[:-1], poses.channels[:-1])
    longer = with_extrapolated_frame(shorter)
    np.testing.assert_allclose(longer.root_position[-1], poses.root_position[-1], atol=2e-3)
    assert (to_rotation(longer.root_orientation) * to_rotation(poses.root_orientation).inv()).magnitude().max() < 2e-3


@pytest.mark.parametrize("num_frames", [3, 10, 29, 500])
def test_seam_weights_meet_in_the_middle(num_frames):
    weights = seam_weights(num_frames, 8)
    assert weights[0] == 0.5
    assert np.all(np.abs(weights) <= 0.5)
    assert np.all(weights[num_frames // 2 + 1 :] <= 0.0)
