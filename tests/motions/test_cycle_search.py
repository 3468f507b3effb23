from dataclasses import replace

import numpy as np
import pytest

from kine2go_warp.motions.cycle_search import (
    best_cycle,
    find_cycles,
    overlaps,
    pose_features,
    seam_scores,
    single_turns,
)
from kine2go_warp.motions.generator import DogGait
from kine2go_warp.motions.sources import AI4Animation
from kine2go_warp.motions.targets import pose_targets
from kine2go_warp.robots import GO2
from tests.motions.test_targets import keypoints


@pytest.fixture(scope="module")
def targets():
    motion, _ = keypoints(DogGait(stride_frames=32, turn_rate=0.3), 200)
    return pose_targets(motion, AI4Animation(), GO2)


def test_whole_strides_are_found_in_a_motion_that_nobody_has_cut(targets):
    found = find_cycles(targets, 20, 100, 8)
    assert all((one.end - one.start) % 32 == 0 for one in found), [(one.start, one.end) for one in found]
    assert all(one.score < 0.05 for one in found)
    assert [one.score for one in found] == sorted(one.score for one in found)


def test_ends_given_by_eye_are_mended(targets):
    start, end = best_cycle(targets, 40, 100, 6)
    assert (end - start) % 32 == 0
    assert abs(start - 40) <= 6
    assert abs(end - 100) <= 6


def test_scores_are_distances(targets):
    features = pose_features(targets)
    starts, ends = np.array([3, 10]), np.array([35, 50, 120])
    expected = [[np.sqrt(np.mean((features[a] - features[b]) ** 2)) for b in ends] for a in starts]
    np.testing.assert_allclose(seam_scores(features, starts, ends), expected, atol=1e-6)


def test_standing_still_is_left_out_when_a_way_is_asked_for(targets):
    assert find_cycles(targets, 20, 100, 5, travel=100.0) == []


def test_jitter_of_a_standing_animal_is_no_way(rng):
    """Stands for 4 s with millimetres of sway and noise, then trots for 4 s."""
    motion, _ = keypoints(DogGait(stride_frames=30), 240)
    still = np.repeat(motion.position[:1], 240, axis=0)
    sway = 0.004 * np.sin(2.0 * np.pi * np.arange(240) / 40.0)
    still += sway[:, None, None] + rng.normal(0.0, 0.002, (240, 1, 3))
    both = replace(motion, time=np.arange(480) / 60.0, position=np.concatenate([still, motion.position]))
    found = find_cycles(pose_targets(both, AI4Animation(), GO2), 21, 100, 8, travel=0.1)
    assert found
    assert all(one.end > 240 for one in found)
    assert found[0].start >= 240
    starts, ends = np.array([(one.start, one.end) for one in found]).T
    assert all(np.sort(overlaps(one, starts, ends))[:-1].max() <= 0.5 for one in found)


def test_a_range_to_the_last_frame_stays_within_the_file(targets):
    _, end = best_cycle(targets, 100, 200, 6)
    assert end <= 199


def test_several_turns_of_a_cycle_are_left_out(targets):
    def lengths(min_frames):
        return {one.end - one.start for one in find_cycles(targets, min_frames, 180, 20) if one.score < 0.2}

    assert lengths(20) == {32}
    # Where single strides are too short to be looked for, two, three and five are no turns of one another.
    assert lengths(40) == {64, 96, 160}


def test_turns_of_a_cycle_that_closes_badly_are_kept():
    lengths = np.array([30, 45, 61, 90])
    np.testing.assert_array_equal(single_turns(lengths, np.array([0.2, 0.9, 0.1, 0.3])), [True, True, False, False])
    np.testing.assert_array_equal(single_turns(lengths, np.array([0.9, 0.9, 0.1, 0.3])), [True, True, True, True])
