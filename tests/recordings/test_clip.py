"""The recording of a clip, read back."""

from dataclasses import replace

import numpy as np
import pytest

from kine2go_warp.recordings.clip import CYCLES, record_clip
from kine2go_warp.recordings.robot import EYE, FOLLOWED
from tests.recordings.conftest import Recorded


@pytest.fixture
def recorded(clip, tmp_path):
    record_clip(clip, tmp_path / "clip.rrd")
    return Recorded(tmp_path / "clip.rrd")


def test_the_robot_goes_through_three_cycles_each_moved_on_by_the_displacement(clip, recorded):
    time, places = recorded.column("/clip/robot/base", "Transform3D:translation")
    places = np.array(places)[:, 0]
    assert len(time) == CYCLES * clip.num_frames
    assert time[-1] == pytest.approx(CYCLES * clip.period - clip.frame_duration)
    assert np.array_equal(places[: clip.num_frames].astype(np.float32), clip.root_position.astype(np.float32))
    for cycle in range(CYCLES):
        part = slice(cycle * clip.num_frames, (cycle + 1) * clip.num_frames)
        step = clip.cycle.repeated(cycle)
        moved = clip.poses.moved(step.x, step.y, step.yaw).root_position
        np.testing.assert_allclose(places[part], moved, atol=1e-5)


def test_the_eye_follows_what_is_not_seen_and_is_as_large_as_its_distance_asks(recorded):
    followed = f"/clip/robot/{FOLLOWED}"
    ends = np.array(recorded.fixed(followed, "Points3D:positions"))
    assert recorded.fixed(followed, "Points3D:radii") == [0.0]
    np.testing.assert_allclose(ends.mean(axis=0), 0.0)
    # The viewer's rule: 1.5 times the diagonal of the box around what is followed.
    assert 1.5 * np.linalg.norm(np.ptp(ends, axis=0)) == pytest.approx(np.linalg.norm(EYE))


def test_stance_bars_are_there_while_a_foot_stands(clip, recorded):
    _, bars = recorded.column("/clip/plots/stance/bars", "Scalars:scalars")
    there = ~np.isnan(np.array(bars, float))
    assert np.array_equal(there, np.tile(clip.stance > 0.5, (CYCLES, 1)))


def test_seams_are_marked_where_a_cycle_begins_again(clip, recorded):
    time, _ = recorded.column("/clip/plots/seam", "Scalars:scalars")
    np.testing.assert_allclose(time, [clip.period, 2 * clip.period], atol=1e-9)
    marks = np.array(recorded.fixed("/clip/ways/seams", "Points3D:positions"))
    steps = [clip.cycle.repeated(cycle) for cycle in (1, 2)]
    expected = [clip.poses.moved(step.x, step.y, step.yaw).root_position[0] for step in steps]
    np.testing.assert_allclose(marks, expected, atol=1e-5)


def test_places_where_feet_stand_are_shown(clip, recorded):
    for foot, leg in enumerate(("FL", "FR", "RL", "RR")):
        points = recorded.fixed(f"/clip/ways/{leg}_stance", "Points3D:positions")
        assert len(points) == CYCLES * int((clip.stance[:, foot] > 0.5).sum())
        np.testing.assert_allclose(points[0], clip.foot_position[clip.stance[:, foot] > 0.5, foot][0], atol=1e-4)


def test_the_sources_keypoints_go_beside_the_robot(clip, recorded):
    time, points = recorded.column("/clip/keypoints/points", "Points3D:positions")
    expected = clip.keypoints.over_cycles(clip.cycle, CYCLES).astype(np.float32)
    assert np.array_equal(np.array(points, np.float32), expected)
    assert len(time) == CYCLES * clip.num_frames
    _, bones = recorded.column("/clip/keypoints/bones", "LineStrips3D:strips")
    pelvis, neck = clip.keypoints.bones[0]
    assert np.array_equal(np.array(bones, np.float32)[7, 0], expected[7, [pelvis, neck]])
    assert recorded.fixed("/clip/keypoints", "Transform3D:translation") == [[0.0, -0.5, 0.0]]


def test_a_clip_without_keypoints_is_recorded_without_them(clip, tmp_path):
    record_clip(replace(clip, keypoints=None), tmp_path / "clip.rrd")
    assert not any("keypoints" in entity for entity in Recorded(tmp_path / "clip.rrd").entities)
