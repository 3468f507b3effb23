"""The source's keypoints that a clip keeps."""

from dataclasses import replace

import numpy as np
import pytest

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.catalogue import motion_named
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.motions.keypoints import KEYPOINTS
from kine2go_warp.motions.retarget import retarget
from kine2go_warp.robots import GO2
from kine2go_warp.rotations import turn_planar

REAL = ("dog_trot", "ai4_dog_trot_00", "vhdc_horse1_s1_walk_01")


@pytest.fixture(scope="module", params=REAL)
def made(request, solver):
    """A clip, and the keypoints of its frames as the source has them."""
    entry = motion_named(request.param)
    folder = None if entry.bundled else request.getfixturevalue("data_folder")
    clip = retarget(entry, folder, solver, RetargetConfig()).clip
    motion = entry.motion_source.load(entry.path(folder))
    return clip, motion.scaled(entry.motion_source.scale).frames(clip.origin.start, clip.origin.end)


def test_they_are_the_animal_in_the_robots_size_moved_as_a_whole(made):
    clip, motion = made
    points, truth = clip.keypoints.position, motion.position
    assert points.shape == (clip.num_frames, len(KEYPOINTS), 3)
    first, last = points.reshape(-1, 3), truth.reshape(-1, 3)
    np.testing.assert_allclose(first[1:, 2] - first[:-1, 2], last[1:, 2] - last[:-1, 2], atol=1e-12)
    ways, true_ways = first[:, :2] - first[0, :2], last[:, :2] - last[0, :2]
    np.testing.assert_allclose(np.linalg.norm(ways, axis=1), np.linalg.norm(true_ways, axis=1), atol=1e-12)


def test_they_stand_on_the_floor_and_go_with_the_robot(made):
    clip, _ = made
    points = clip.keypoints.position
    toes = points[:, [KEYPOINTS.index(f"{leg}_toe") for leg in ("FL", "FR", "RL", "RR")]]
    # The floor is that of the whole file.
    assert abs(np.quantile(toes[..., 2], 0.1)) < 0.02
    middle = points[:, [KEYPOINTS.index("pelvis"), KEYPOINTS.index("neck")]].mean(axis=1)
    apart = np.linalg.norm((middle - clip.root_position)[:, :2], axis=1)
    assert apart.mean() < 0.03
    assert apart.max() < 0.08


def test_bones_join_hips_to_their_own_toes(clip):
    names = clip.keypoints.names
    bones = {(names[first], names[second]) for first, second in clip.keypoints.bones}
    assert {(f"{leg}_hip", f"{leg}_toe") for leg in ("FL", "FR", "RL", "RR")} < bones
    assert {("pelvis", "neck"), ("neck", "FR_hip"), ("pelvis", "RL_hip")} < bones


def test_each_cycle_goes_on_where_the_one_before_ended(clip):
    points = clip.keypoints.over_cycles(clip.cycle, 3)
    assert len(points) == 3 * clip.num_frames
    steps = np.linalg.norm(np.diff(points, axis=0), axis=-1).max(axis=-1)
    # The bundled gait is periodic, so the seams are no larger than other steps.
    seams = [clip.num_frames - 1, 2 * clip.num_frames - 1]
    assert steps[seams].max() <= 1.1 * np.delete(steps, seams).max()
    way = np.array([clip.cycle.x, clip.cycle.y, 0.0])
    moved = turn_planar(points[: clip.num_frames], clip.cycle.yaw) + way
    np.testing.assert_allclose(points[clip.num_frames : 2 * clip.num_frames], moved, atol=1e-12)


def test_resampling_keeps_them_in_time(clip):
    same = clip.resampled(60.0, GO2)
    np.testing.assert_allclose(same.keypoints.position, clip.keypoints.position, atol=1e-9)
    twice = clip.resampled(120.0, GO2).keypoints.position
    np.testing.assert_allclose(twice[::2], clip.keypoints.position, atol=1e-9)
    between = 0.5 * (clip.keypoints.position[3] + clip.keypoints.position[4])
    np.testing.assert_allclose(twice[7], between, atol=1e-9)


def test_a_file_keeps_them_and_need_not_have_any(clip, tmp_path):
    clip.save(tmp_path / "with.npz")
    kept = MotionClip.load(tmp_path / "with.npz").keypoints
    assert (kept.names, kept.bones) == (clip.keypoints.names, clip.keypoints.bones)
    assert np.array_equal(kept.position, clip.keypoints.position)
    without = replace(clip, keypoints=None)
    without.save(tmp_path / "without.npz")
    loaded = MotionClip.load(tmp_path / "without.npz")
    assert loaded.keypoints is None
    assert loaded.content_hash() == clip.content_hash(), "they are no part of the motion"
    assert loaded.resampled(120.0, GO2).keypoints is None


@pytest.mark.parametrize(("name", "value"), [("keypoint_bone", [[0, 99]]), ("keypoint_position", np.zeros((30, 4, 3)))])
def test_keypoints_that_do_not_fit_are_refused(clip, tmp_path, name, value):
    clip.save(tmp_path / "clip.npz")
    with np.load(tmp_path / "clip.npz") as data:
        arrays = {**data, name: np.array(value)}
    np.savez(tmp_path / "bad.npz", **arrays)
    with pytest.raises(ClipError, match=r"bad\.npz: not a clip"):
        MotionClip.load(tmp_path / "bad.npz")
