"""Retargeting rules on the generator's gaits, whose truth is known, and under moves of the source."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.generator import DogGait, generate
from kine2go_warp.motions.keypoints import KEYPOINTS, KeypointMotion
from kine2go_warp.motions.sources import AI4Animation
from kine2go_warp.motions.sources.ai4animation import COLUMN_OF_KEYPOINT
from kine2go_warp.motions.targets import pose_targets
from kine2go_warp.robots import GO2
from kine2go_warp.rotations import heading, to_rotation

SOURCE = AI4Animation()


def keypoints(gait, num_frames=120):
    generated = generate(gait, num_frames)
    position = generated.points[:, [COLUMN_OF_KEYPOINT[name] for name in KEYPOINTS]]
    return KeypointMotion(np.arange(num_frames) / gait.rate, position), generated


def test_the_base_follows_the_trunk_level_and_at_the_scaled_speed():
    motion, generated = keypoints(DogGait(turn_rate=0.5))
    targets = pose_targets(motion, SOURCE, GO2)
    np.testing.assert_allclose(targets.root_position[:, :2], SOURCE.scale * generated.trunk[:, :2], atol=1e-9)
    np.testing.assert_allclose(heading(targets.root_orientation), generated.heading, atol=1e-9)
    up = to_rotation(targets.root_orientation).apply([0.0, 0.0, 1.0])
    assert np.degrees(np.arccos(up[:, 2])).max() < 0.2


def test_a_standing_foot_stands_on_the_floor_and_a_swinging_one_is_lifted():
    gait = DogGait()
    motion, generated = keypoints(gait)
    height = pose_targets(motion, SOURCE, GO2).feet[..., 2] - GO2.foot_radius
    np.testing.assert_allclose(height[generated.contact], 0.0, atol=1e-9)
    assert height.min() >= -1e-12
    assert height.max() == pytest.approx(SOURCE.scale * gait.step_height, abs=2e-3)


def test_a_standing_foot_does_not_slide():
    motion, generated = keypoints(DogGait(turn_rate=0.0))
    feet = pose_targets(motion, SOURCE, GO2).feet
    both = generated.contact[1:] & generated.contact[:-1]
    assert (np.linalg.norm(np.diff(feet, axis=0), axis=-1) * 60.0)[both].max() < 0.01


@pytest.mark.parametrize("yaw", [0.4, 2.0, -3.0])
def test_turning_and_moving_the_animal_turns_and_moves_the_robot(yaw):
    motion, _ = keypoints(DogGait(turn_rate=0.3))
    turn, shift = Rotation.from_rotvec([0.0, 0.0, yaw]), np.array([4.0, -2.0, 0.0])
    moved_points = turn.apply(motion.position.reshape(-1, 3)).reshape(motion.position.shape) + shift
    here = pose_targets(motion, SOURCE, GO2)
    there = pose_targets(replace(motion, position=moved_points), SOURCE, GO2)
    expected_shift = SOURCE.scale * shift
    np.testing.assert_allclose(there.root_position, turn.apply(here.root_position) + expected_shift, atol=1e-9)
    feet = turn.apply(here.feet.reshape(-1, 3)).reshape(here.feet.shape) + expected_shift
    np.testing.assert_allclose(there.feet, feet, atol=1e-9)
    error = to_rotation(there.root_orientation) * (turn * to_rotation(here.root_orientation)).inv()
    assert error.magnitude().max() < 1e-9


def test_an_animal_without_extent_is_refused():
    motion, _ = keypoints(DogGait())
    with pytest.raises(ClipError, match="no orientation"):
        pose_targets(replace(motion, position=np.zeros_like(motion.position)), replace_lift(), GO2)


def replace_lift():
    class Flat(AI4Animation):
        forward_lift = 0.0

    return Flat()
