import numpy as np
import pytest

from kine2go_warp.motions.cycle import CycleStep, close_cycle, extend, seam_weights
from kine2go_warp.motions.poses import Poses
from kine2go_warp.rotations import from_rotation, heading, to_rotation, yaw_rotation


def walk_on_a_circle(num_frames, turn=0.8, seam=0.0):
    """T + 2 poses on a circle, with a seam of a given size in height, tilt and joints at frame T."""
    share = np.arange(num_frames + 2) / num_frames
    yaw = turn * share
    radius = 2.0
    position = np.stack([radius * np.sin(yaw), radius * (1.0 - np.cos(yaw)), 0.3 + seam * share], axis=1)
    tilt = np.stack([0.1 + seam * share, -0.05 + 0.0 * share], axis=1)
    from scipy.spatial.transform import Rotation

    orientation = from_rotation(yaw_rotation(yaw) * Rotation.from_euler("yx", tilt))
    joints = 0.4 * np.sin(2.0 * np.pi * share[:, None] + np.arange(12)) + seam * share[:, None]
    feet = position[:, None] * [1.0, 1.0, 0.0] + np.zeros((4, 1))
    return Poses(position, orientation, joints, feet)


def moved(poses, step):
    return poses.moved(step.x, step.y, step.yaw)


def test_steps_compose_and_undo_each_other():
    step = CycleStep(0.3, -0.1, 0.7)
    poses = Poses(np.array([[0.2, 0.1, 0.3]]), np.array([[1.0, 0.0, 0.0, 0.0]]), feet=np.ones((1, 4, 3)))
    there = moved(poses, step.repeated(5))
    one_by_one = poses
    for _ in range(5):
        one_by_one = moved(one_by_one, step)
    np.testing.assert_allclose(there.root_position, one_by_one.root_position, atol=1e-12)
    np.testing.assert_allclose(there.feet, one_by_one.feet, atol=1e-12)
    back = moved(there, step.repeated(-5))
    np.testing.assert_allclose(back.root_position, poses.root_position, atol=1e-12)
    np.testing.assert_allclose(heading(back.root_orientation), 0.0, atol=1e-12)


def test_a_cycle_without_a_seam_is_left_as_it_is():
    poses = walk_on_a_circle(40).recentred()
    closed, cycle = close_cycle(poses, 40, 8)
    np.testing.assert_allclose(closed.root_position, poses.root_position[:40], atol=1e-9)
    np.testing.assert_allclose(closed.joints, poses.joints[:40], atol=1e-9)
    np.testing.assert_allclose(closed.feet, poses.feet[:40], atol=1e-9)
    np.testing.assert_allclose([cycle.x, cycle.y], poses.root_position[40, :2])
    assert cycle.yaw == pytest.approx(0.8)


def test_a_seam_is_closed_to_the_size_of_a_normal_step():
    closed, cycle = close_cycle(walk_on_a_circle(40, seam=0.2), 40, 8)
    longer = extend(closed, cycle, 0, 40)
    steps = np.abs(np.diff(longer.joints, axis=0)).max(axis=1)
    assert steps[39] < 1.5 * np.median(steps), "the step across the seam"
    rises = np.abs(np.diff(longer.root_position[:, 2]))
    assert rises[39] < 0.05
    turns = (to_rotation(longer.root_orientation[1:]) * to_rotation(longer.root_orientation[:-1]).inv()).magnitude()
    assert turns[39] < 0.05


def test_velocities_of_the_base_meet_at_the_seam():
    """A base that speeds up, turns ever faster and rises: closed, nothing of it jumps, and the way is kept."""
    num_frames, blend = 120, 24
    time = np.arange(num_frames + 2) / num_frames
    yaw = 0.3 * time**2
    position = np.stack([time + 0.5 * time**2, 0.2 * time**2, 0.3 + 0.05 * time * (time - 1.0)], axis=1)
    poses = Poses(position, from_rotation(yaw_rotation(yaw)), np.zeros((len(time), 12)))
    closed, cycle = close_cycle(poses, num_frames, blend)
    longer = extend(closed, cycle, 0, num_frames)

    def jumps(values):
        return np.abs(np.diff(values, 2, axis=0)).reshape(2 * num_frames - 2, -1).max(axis=1)

    before = np.abs(np.diff(position[:2], axis=0) - np.diff(position[-2:], axis=0)).max()
    for values in (longer.root_position, np.unwrap(heading(longer.root_orientation))):
        found = jumps(values)
        assert found[num_frames - 1] < 0.1 * before, "at the seam"
        assert found.max() < 0.15 * before, "and nowhere else instead"
    assert np.hypot(cycle.x, cycle.y) == pytest.approx(np.hypot(*position[num_frames, :2]), rel=0.03)
    middle = slice(blend + 1, num_frames - blend)
    kept = np.diff(closed.root_position[middle, 2], 2), np.diff(position[middle, 2], 2)
    np.testing.assert_allclose(*kept, atol=1e-12)


def test_the_root_does_not_pause_at_the_seam():
    closed, cycle = close_cycle(walk_on_a_circle(40), 40, 8)
    longer = extend(closed, cycle, 0, 41)
    steps = np.linalg.norm(np.diff(longer.root_position[:, :2], axis=0), axis=1)
    np.testing.assert_allclose(steps, steps[0], rtol=1e-6)


def test_recentring_starts_at_the_origin_with_heading_zero():
    poses = walk_on_a_circle(10)
    moved = poses.moved(5.0, 1.0, 2.0)
    back = moved.recentred()
    np.testing.assert_allclose(back.root_position, poses.recentred().root_position, atol=1e-9)
    np.testing.assert_allclose(back.feet, poses.recentred().feet, atol=1e-9)
    np.testing.assert_allclose(back.root_position[0, :2], 0.0, atol=1e-12)
    assert heading(back.root_orientation)[0] == pytest.approx(0.0, abs=1e-12)


def test_an_extrapolated_frame_goes_on_at_the_last_velocity():
    poses = walk_on_a_circle(40)
    longer = poses.frames(0, 41).extrapolated(1)
    np.testing.assert_allclose(longer.root_position[-1], poses.root_position[-1], atol=2e-3)
    assert (to_rotation(longer.root_orientation) * to_rotation(poses.root_orientation).inv()).magnitude().max() < 2e-3


@pytest.mark.parametrize("num_frames", [3, 10, 29, 500])
def test_seam_weights_meet_in_the_middle(num_frames):
    weights = seam_weights(num_frames, 8)
    assert weights[0] == 0.5
    assert np.all(np.abs(weights) <= 0.5)
    assert np.all(weights[num_frames // 2 + 1 :] <= 0.0)
