import numpy as np
import pytest

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.variation import Variation
from kine2go_warp.rotations import heading, rotation_angle

OTHER_SIDE = [3, 4, 5, 0, 1, 2, 9, 10, 11, 6, 7, 8]
SIGNS = np.tile([-1.0, 1.0, 1.0], 4)


def test_no_variation_is_the_clip_itself(clip):
    assert Variation().of(clip) is clip


def test_a_time_scale_stretches_the_period_and_slows_everything_in_proportion(clip):
    slow = Variation(time_scale=1.1).of(clip)
    assert slow.period == pytest.approx(1.1 * clip.period)
    np.testing.assert_array_equal(slow.joint_position, clip.joint_position)
    np.testing.assert_array_equal(slow.root_position, clip.root_position)
    for name in ("root_linear_velocity", "root_angular_velocity", "joint_velocity"):
        np.testing.assert_allclose(getattr(slow, name), getattr(clip, name) / 1.1, atol=1e-12)


def test_the_mirror_image_has_every_foot_where_the_other_side_s_was(clip):
    image = Variation(mirrored=True).of(clip)
    feet = clip.foot_position[:, [1, 0, 3, 2]] * [1.0, -1.0, 1.0]
    np.testing.assert_allclose(image.foot_position, feet, atol=1e-9)
    np.testing.assert_array_equal(image.joint_position, clip.joint_position[:, OTHER_SIDE] * SIGNS)
    np.testing.assert_allclose(image.root_linear_velocity, clip.root_linear_velocity * [1.0, -1.0, 1.0], atol=1e-9)
    np.testing.assert_allclose(image.root_angular_velocity, clip.root_angular_velocity * [-1.0, 1.0, -1.0], atol=1e-9)
    twice = Variation(mirrored=True).of(image)
    np.testing.assert_array_equal(twice.joint_position, clip.joint_position)


def test_a_clip_played_once_is_mirrored_and_stretched_but_its_ends_take_no_offset(once_clip):
    varied = Variation(time_scale=1.1, mirrored=True).of(once_clip)
    assert varied.kind == "once"
    assert varied.period == pytest.approx(1.1 * once_clip.period)
    assert varied.displacement[1] == pytest.approx(-once_clip.displacement[1], abs=1e-12)
    assert not varied.joint_velocity[[0, -1]].any()
    with pytest.raises(ClipError, match="start_and_stop is played once and takes no speed_offset"):
        Variation(turn_offset=0.1).of(once_clip)


@pytest.mark.parametrize("variation", [
    Variation(speed_offset=0.2), Variation(turn_offset=-0.4), Variation(0.9, False, -0.1, 0.3),
])  # fmt: skip
def test_offsets_are_added_to_the_root_in_every_cycle(clip, variation):
    varied = variation.of(clip)
    count = 3 * clip.num_frames
    before, after = clip.extended(0, count), varied.extended(0, count)
    time = np.arange(len(after)) * clip.frame_duration * variation.time_scale
    yaw = [np.unwrap(heading(poses.root_orientation)) for poses in (before, after)]
    np.testing.assert_allclose(yaw[1] - yaw[0], variation.turn_offset * time, atol=1e-9)
    # The path, integrated with ten steps in each frame from the clip's own velocities.
    fine = np.linspace(0.0, len(time) - 1, 10 * (len(time) - 1) + 1)
    frames = np.arange(len(time))
    steps = np.diff(before.root_position[:, :2], axis=0) / (clip.frame_duration * variation.time_scale)
    own = np.repeat(steps, 10, axis=0)
    middle = 0.5 * (fine[1:] + fine[:-1])
    turned = variation.turn_offset * np.interp(middle, frames, time)
    along = np.interp(middle, frames, yaw[1])
    cosine, sine = np.cos(turned), np.sin(turned)
    velocity = np.stack([cosine * own[:, 0] - sine * own[:, 1], sine * own[:, 0] + cosine * own[:, 1]], axis=-1)
    velocity += variation.speed_offset * np.stack([np.cos(along), np.sin(along)], axis=-1)
    path = np.cumsum(velocity * (time[1] - time[0]) / 10.0, axis=0)[9::10]
    np.testing.assert_allclose(after.root_position[1:, :2] - after.root_position[0, :2], path, atol=1e-4)
    np.testing.assert_allclose(after.root_position[:, 2], before.root_position[:, 2], atol=1e-12)


def test_a_varied_clip_is_consistent_across_its_seam(clip):
    varied = Variation(1.1, True, 0.1, 0.5).of(clip)
    longer = varied.extended(0, 2)
    assert rotation_angle(longer.root_orientation[1:], longer.root_orientation[:-1]).max() < 0.1
    step = np.linalg.norm(np.diff(longer.root_position, axis=0), axis=-1)
    assert step.max() < 2.0 * np.median(step)
