"""A reference that is stitched from clips as it is steered."""

import numpy as np
import pytest

from kine2go_warp.deployment.reference import PlacedClip
from kine2go_warp.deployment.rotations import heading
from kine2go_warp.deployment.steering import Command, Frames, MatchingConfig, SteeredReference
from kine2go_warp.errors import ClipError
from kine2go_warp.motions.variation import Variation

RATE = 60.0
STRAIGHT = MatchingConfig(bend=0.0)


def steered(clips, command, config=STRAIGHT):
    return SteeredReference(Frames.of(clips, RATE, config.look_ahead), RATE, config, command)


def speeds(reference, steps):
    """Speed over the ground between whole steps [m/s]."""
    position = np.array([reference.root(step).position[:2] for step in steps])
    return RATE * np.linalg.norm(np.diff(position, axis=0), axis=-1)


def test_one_clip_is_played_as_it_is(clip):
    reference, placed = steered([clip], Command(0.6, 0.0)), PlacedClip(clip, RATE)
    first = int(
        np.argmin([np.abs(placed.joint_position(step) - reference.joint_position(0)).max() for step in range(30)])
    )
    placed.place(first / 30.0, (0.0, 0.0), -heading(placed.root(first).rotation))
    for step in (0.0, 7.0, 33.5, 95.0):
        np.testing.assert_allclose(reference.joint_position(step), placed.joint_position(step), atol=1e-6)
        np.testing.assert_allclose(reference.root(step).position, placed.root(step).position, atol=2e-4)
        np.testing.assert_allclose(reference.root(step).rotation, placed.root(step).rotation, atol=1e-3)
    assert reference.jumps == 0


def test_it_goes_over_to_the_clip_that_suits_the_command_and_joints_do_not_jump(clip):
    slow = Variation(time_scale=2.0).of(clip)
    reference = steered([clip, slow], Command(0.3, 0.0))
    assert speeds(reference, range(60)).mean() == pytest.approx(
        speeds(PlacedClip(slow, RATE), range(60)).mean(), rel=0.1
    )
    reference.command = Command(0.7, 0.0)
    reference.grow(240)
    assert reference.jumps >= 1
    expected = speeds(PlacedClip(clip, RATE), range(60)).mean()
    assert speeds(reference, range(180, 240)).mean() == pytest.approx(expected, rel=0.05)
    changes = np.abs(np.diff([reference.joint_position(step) for step in range(240)], axis=0)).max()
    fastest = np.abs(np.diff([PlacedClip(clip, RATE).joint_position(step) for step in range(31)], axis=0)).max()
    assert changes < 1.5 * fastest, "the fade spreads a jump over many steps"


def test_the_velocity_is_the_derivative_of_the_position(clip):
    reference = steered([clip, Variation(time_scale=1.6).of(clip)], Command(0.6, 0.0))
    reference.command = Command(0.3, 0.0)
    position = np.array([reference.joint_position(step) for step in range(120)])
    velocity = np.array([reference.joint_velocity(step) for step in range(120)])
    np.testing.assert_allclose(velocity[1:-1], 0.5 * RATE * (position[2:] - position[:-2]), atol=1e-6)


def test_a_turn_that_no_clip_has_bends_the_path(clip):
    reference = steered([clip], Command(0.6, 0.3), MatchingConfig(bend=0.2))
    reference.grow(300)
    turned = np.unwrap([heading(reference.root(step).rotation) for step in range(301)])
    assert (turned[300] - turned[60]) / 4.0 == pytest.approx(0.2, abs=0.01)
    assert np.abs(np.diff(turned)).max() < 0.05


def test_mirrored_clips_turn_the_other_way(clip):
    left = Variation(turn_offset=0.6).of(clip)
    right = Variation(mirrored=True).of(left)
    reference = steered([left, right], Command(0.6, -0.6))
    turned = np.unwrap([heading(reference.root(step).rotation) for step in range(121)])
    assert turned[120] / 2.0 == pytest.approx(-0.6, abs=0.1)


def test_clips_that_are_played_once_cannot_be_stitched(once_clip):
    with pytest.raises(ClipError, match="none of the clips is a cycle"):
        steered([once_clip], Command(0.0, 0.0))
