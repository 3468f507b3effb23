import contextlib
from dataclasses import replace

import numpy as np
import pytest

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.motions.cycle import CycleStep
from kine2go_warp.robots import GO2
from kine2go_warp.robots.kinematics import foot_positions
from kine2go_warp.rotations import heading, to_rotation
from tests.conftest import COMMITTED_CLIP


def test_the_bundled_clip_is_one_clean_stride(clip):
    assert clip.num_frames == 30
    assert clip.period == pytest.approx(0.5)
    np.testing.assert_allclose(clip.root_position[0, :2], 0.0, atol=1e-12)
    assert heading(clip.root_orientation)[0] == pytest.approx(0.0, abs=1e-12)
    assert clip.cycle.x == pytest.approx(0.825 * 0.75 * 0.5, rel=1e-3)
    assert clip.residual.max() < 1e-3
    assert (clip.foot_position[..., 2] - GO2.foot_radius).min() > -1e-3
    assert np.all((clip.joint_position > GO2.joint_lower) & (clip.joint_position < GO2.joint_upper))


def test_the_committed_clip_of_machines_without_placo_is_the_same_motion(clip):
    committed = MotionClip.load(COMMITTED_CLIP)
    again = "; write it again with 'kine2go motion retarget dog_trot --out tests/data'"
    assert (committed.name, committed.robot, committed.num_frames) == (clip.name, clip.robot, clip.num_frames), again
    np.testing.assert_allclose(committed.joint_position, clip.joint_position, atol=0.1, err_msg=again)
    np.testing.assert_allclose(committed.root_position, clip.root_position, atol=0.03, err_msg=again)


def test_velocities_are_the_derivatives_of_a_spline_through_the_poses(clip):
    from scipy.interpolate import CubicSpline

    fine = clip.resampled(240.0, GO2)
    for values, speeds in (
        (fine.joint_position, fine.joint_velocity),
        (fine.root_position[:, 2:], fine.root_linear_velocity[:, 2:]),
    ):
        time = np.arange(len(values) + 1) * fine.frame_duration
        spline = CubicSpline(time, np.vstack([values, values[:1]]), bc_type="periodic")
        np.testing.assert_allclose(speeds, spline(time[:-1], 1), atol=0.02 * np.abs(speeds).max())


def test_the_mean_velocity_is_the_displacement_over_the_period(clip):
    mean = clip.root_linear_velocity.mean(axis=0)
    np.testing.assert_allclose(mean[:2] * clip.period, [clip.cycle.x, clip.cycle.y], atol=1e-9)
    assert abs(mean[2]) < 1e-9


def test_angular_velocity_turns_the_root(clip):
    poses = clip.extended(0, 1)
    rotations = to_rotation(poses.root_orientation)
    turns = (rotations[1:] * rotations[:-1].inv()).as_rotvec() / clip.frame_duration
    between = 0.5 * (clip.root_angular_velocity + np.roll(clip.root_angular_velocity, -1, axis=0))
    np.testing.assert_allclose(between, turns, atol=0.05)


def test_feet_are_those_of_forward_kinematics(clip):
    rotation = to_rotation(clip.root_orientation).as_matrix()
    feet = np.einsum("tij,tkj->tki", rotation, foot_positions(GO2, clip.joint_position)) + clip.root_position[:, None]
    np.testing.assert_allclose(clip.foot_position, feet, atol=1e-12)


@pytest.mark.parametrize("rate", [50.0, 120.0])
def test_a_clip_played_once_ends_at_its_last_frame_at_any_rate_and_is_read_as_it_was_saved(once_clip, tmp_path, rate):
    other = once_clip.resampled(rate, GO2)
    assert (other.kind, other.span) == ("once", other.num_frames - 1)
    assert other.period == pytest.approx(once_clip.period)
    np.testing.assert_allclose(other.joint_position[[0, -1]], once_clip.joint_position[[0, -1]], atol=1e-9)
    assert other.displacement == pytest.approx(once_clip.displacement, abs=1e-9)
    other.save(tmp_path / "clip.npz")
    loaded = MotionClip.load(tmp_path / "clip.npz")
    assert loaded.cycle is None
    assert loaded.content_hash() == other.content_hash() != replace(other, cycle=CycleStep(0, 0, 0)).content_hash()
    longer = loaded.extended(5, 7)
    np.testing.assert_array_equal(longer.root_position[:6], np.tile(loaded.root_position[:1], (6, 1)))
    np.testing.assert_array_equal(longer.joints[-8:], np.tile(loaded.joint_position[-1:], (8, 1)))


@pytest.mark.parametrize("rate", [50.0, 60.0, 120.0, 37.0])
def test_resampling_keeps_period_and_path_in_time(clip, rate):
    other = clip.resampled(rate, GO2)
    assert other.period == pytest.approx(clip.period)
    assert other.num_frames == round(clip.period * rate)
    assert other.cycle == clip.cycle
    # Back at the old instants, the path is the same.
    back = other.resampled(60.0, GO2)
    np.testing.assert_allclose(back.root_position, clip.root_position, atol=5e-3)
    np.testing.assert_allclose(back.joint_position, clip.joint_position, atol=0.06)


def test_saving_and_loading_changes_nothing(clip, tmp_path):
    clip.save(tmp_path / "clip.npz")
    loaded = MotionClip.load(tmp_path / "clip.npz")
    # test_skeleton.py and test_fidelity.py look at these two.
    aside = {"keypoints": None, "fidelity": None}
    for name, value in vars(replace(clip, **aside)).items():
        np.testing.assert_array_equal(getattr(replace(loaded, **aside), name), value, err_msg=name)
    assert loaded.content_hash() == clip.content_hash()
    assert loaded.content_hash() != replace(clip, frame_duration=0.02).content_hash()
    assert [path.name for path in tmp_path.iterdir()] == ["clip.npz"], "no temporary file is left"


@pytest.mark.parametrize("content", [b"", b"not a zip", None])
def test_what_is_not_a_clip_is_refused(tmp_path, content):
    path = tmp_path / "clip.npz"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ClipError, match="kine2go motion retarget"):
        MotionClip.load(path)


def test_a_pickle_in_the_file_is_not_run(tmp_path):
    path = tmp_path / "clip.npz"
    np.savez(path, header=np.array({"a": 1}, dtype=object))
    with pytest.raises(ClipError):
        MotionClip.load(path)


def test_a_damaged_clip_is_refused_wherever_the_damage_is(clip, tmp_path, rng):
    clip.save(tmp_path / "clip.npz")
    content = (tmp_path / "clip.npz").read_bytes()
    for _ in range(100):
        damaged = bytearray(content)
        for place in rng.integers(0, len(content), 3):
            damaged[place] ^= int(rng.integers(1, 256))
        (tmp_path / "clip.npz").write_bytes(bytes(damaged))
        with contextlib.suppress(ClipError):
            MotionClip.load(tmp_path / "clip.npz")


def test_a_clip_of_another_format_says_what_to_do(clip, tmp_path, monkeypatch):
    monkeypatch.setattr("kine2go_warp.motions.clip.FORMAT_VERSION", 1)
    clip.save(tmp_path / "clip.npz")
    monkeypatch.undo()
    with pytest.raises(ClipError, match="clip format 1, expected 2; retarget it again"):
        MotionClip.load(tmp_path / "clip.npz")
