from dataclasses import replace

import numpy as np
import pytest
import warp as wp

from kine2go_warp.env.clips import make_placement, make_reference_state, upload_clips
from kine2go_warp.kernels.reference import sample_reference
from kine2go_warp.motions.cycle import CycleStep
from kine2go_warp.robots import GO2
from tests.kernels.oracle import reference_at, stacked

CONTROL = 1.0 / 60.0


@pytest.fixture
def turning_clip(clip):
    """A clip whose cycle turns, so that cycles compose a circle."""
    return replace(clip, cycle=CycleStep(0.3, 0.05, 0.4))


def sample(clips, which, phase, heading, origin, step):
    device = wp.get_device()
    count = len(which)
    placement = make_placement(count, device)
    placement.clip.assign(np.int32(which))
    placement.start_phase.assign(np.float32(phase))
    placement.heading.assign(np.float32(heading))
    placement.origin.assign(np.float32(origin))
    reference = make_reference_state(count, device)
    inputs = [upload_clips(clips, CONTROL, device), placement, wp.array(np.int32(step), device=device), reference]
    wp.launch(sample_reference, dim=count, inputs=inputs, device=device)
    return reference


def assert_agrees(reference, expected):
    root = reference.root.numpy()
    np.testing.assert_allclose(root[:, :3], expected.position, rtol=1e-5, atol=1e-5)
    assert np.max(1.0 - np.abs(np.sum(root[:, 3:] * expected.quaternion, axis=1))) < 1e-6
    np.testing.assert_allclose(reference.linear_velocity.numpy(), expected.linear, rtol=1e-5, atol=2e-5)
    np.testing.assert_allclose(reference.angular_velocity.numpy(), expected.angular, rtol=1e-5, atol=2e-5)
    np.testing.assert_allclose(reference.joint_position.numpy(), expected.joint, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(reference.joint_velocity.numpy(), expected.joint_speed, rtol=1e-5, atol=2e-4)


def test_random_places_of_two_clips_agree_with_numpy(clip, turning_clip, rng):
    clips, count = [clip, turning_clip], 200
    which, step = rng.integers(0, 2, count), rng.integers(0, 200, count)
    phase, heading = np.float32(rng.uniform(0.0, 1.0, count)), np.float32(rng.uniform(-np.pi, np.pi, count))
    origin = np.float32(rng.normal(0.0, 2.0, (count, 2)))
    expected = stacked(
        [
            reference_at(clips[c], float(p) * clips[c].num_frames + s, float(h), o)
            for c, p, h, o, s in zip(which, phase, heading, origin, step, strict=True)
        ]
    )
    assert_agrees(sample(clips, which, phase, heading, origin, step), expected)


def test_a_clip_played_once_stays_at_rest_beyond_both_ends(clip, once_clip, rng):
    clips, count = [clip, once_clip], 400
    which, step = rng.integers(0, 2, count), rng.integers(0, 150, count)
    phase, heading = np.float32(rng.uniform(-1.0, 1.0, count)), np.float32(rng.uniform(-np.pi, np.pi, count))
    phase[which == 0] = np.abs(phase[which == 0])
    origin = np.float32(rng.normal(0.0, 2.0, (count, 2)))
    frames = phase * np.where(which == 1, once_clip.num_frames - 1, clip.num_frames) + step
    beyond = (which == 1) & ((frames < 0.0) | (frames > once_clip.num_frames - 1))
    assert 15 < np.sum(frames < 0.0) < np.sum(beyond) < np.sum(which == 1), "the test must see all places"
    found = sample(clips, which, phase, heading, origin, step)
    expected = [
        reference_at(clips[c], float(f), float(h), o) for c, f, h, o in zip(which, frames, heading, origin, strict=True)
    ]
    assert_agrees(found, stacked(expected))
    for speeds in (found.linear_velocity, found.angular_velocity, found.joint_velocity):
        assert not speeds.numpy()[beyond].any()
        assert speeds.numpy()[(which == 1) & ~beyond].any()


def test_around_the_seam_the_reference_goes_on_without_a_jump(turning_clip):
    frames = turning_clip.num_frames
    steps = np.arange(frames - 2, frames + 3)
    count = len(steps)
    reference = sample(
        [turning_clip], np.zeros(count), np.zeros(count), np.full(count, 3.1), np.zeros((count, 2)), steps
    )
    expected = stacked([reference_at(turning_clip, float(step), 3.1, np.zeros(2)) for step in steps])
    assert_agrees(reference, expected)
    inside = np.linalg.norm(np.diff(turning_clip.root_position, axis=0), axis=1).max()
    assert np.linalg.norm(np.diff(reference.root.numpy()[:, :3], axis=0), axis=1).max() < 1.5 * inside + 0.06


@pytest.mark.parametrize("rate", [120.0, 50.0])
def test_a_clip_of_another_rate_keeps_its_speed(clip, rate):
    other = clip.resampled(rate, GO2)
    count = 50
    steps = np.arange(count)
    zeros = np.zeros(count)
    a = sample([clip], zeros, zeros, zeros, np.zeros((count, 2)), steps)
    b = sample([other], zeros, zeros, zeros, np.zeros((count, 2)), steps)
    np.testing.assert_allclose(a.root.numpy()[:, :3], b.root.numpy()[:, :3], atol=2e-3)
    # Linear interpolation cuts the corners where feet come to stand.
    np.testing.assert_allclose(a.joint_position.numpy(), b.joint_position.numpy(), atol=0.05)
    np.testing.assert_allclose(np.mean(a.joint_position.numpy() - b.joint_position.numpy(), axis=0), 0.0, atol=3e-3)
