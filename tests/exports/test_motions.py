"""Motions for other trackers: what is written comes back, and links move as joints and base do."""

import json
from dataclasses import replace

import numpy as np
import pytest

from kine2go_warp.cli.main import main
from kine2go_warp.errors import ClipError, ExportError
from kine2go_warp.exports.clips import clip_motion, export_clips
from kine2go_warp.exports.export import export_dataset
from kine2go_warp.exports.motions import BODY_ARRAYS, MOTION_TARGETS
from kine2go_warp.motions.sources import SOURCES
from kine2go_warp.motions.sources.recognition import recognise
from kine2go_warp.robots import GO2
from kine2go_warp.robots.kinematics import foot_positions
from kine2go_warp.rotations import from_rotation, rotation_between, to_rotation

READ_BY = {
    "mjlab": "clip",
    "mimickit": "mimickit",
    "amp": "amp",
    "humanoidverse": "humanoidverse",
    "protomotions": "protomotions",
    "unitree": "joint_table",
}
every_format = pytest.mark.parametrize("form", READ_BY)


def test_every_format_has_a_way_back():
    assert set(READ_BY) == set(MOTION_TARGETS)


@every_format
def test_a_clip_that_is_exported_can_be_imported(form, clip, tmp_path):
    (path,) = export_clips([clip], form, tmp_path / "out")
    source, motion = recognise(path, SOURCES)
    assert source.name == READ_BY[form]
    assert motion.num_frames == clip.num_frames + 1
    np.testing.assert_allclose(motion.points("toe")[:-1], clip.foot_position, atol=1e-6)
    np.testing.assert_allclose(np.diff(motion.time), clip.frame_duration, rtol=1e-6)


@every_format
def test_a_trajectory_that_is_exported_can_be_imported(form, clip, store, tmp_path, monkeypatch):
    steady = {name: np.asarray(values, np.float32) for name, values in clip_motion(clip).rows.items()}
    monkeypatch.setattr("kine2go_warp.exports.motions.as_motion", lambda *_: replace(clip_motion(clip), rows=steady))
    export_dataset(store, form, tmp_path / "out", ["one"])
    files = sorted(path.name for path in (tmp_path / "out" / "one").iterdir())
    assert files == [f"trajectory-000{index}{MOTION_TARGETS[form].suffix}" for index in range(3)]
    motion = SOURCES[READ_BY[form]].load(tmp_path / "out" / "one" / files[0])
    np.testing.assert_allclose(motion.points("toe")[:-1], clip.foot_position, atol=1e-6)


@every_format
def test_a_foot_that_twitches_comes_back(form, clip, tmp_path):
    joints = clip.joint_position.copy()
    joints[20, 1::3] += 0.09  # thighs; the feet of standing legs are off by some 3 cm
    twitching = replace(clip, joint_position=joints)
    (path,) = export_clips([twitching], form, tmp_path / "out")
    motion = SOURCES[READ_BY[form]].load(path)
    assert motion.remarks == ()
    feet = clip_motion(twitching).rows["link_position"][:, 12:]
    np.testing.assert_allclose(motion.points("toe"), feet, atol=1e-6)


def test_links_of_a_clip_move_as_base_and_joints_do(clip):
    motion, step = clip_motion(clip), 1e-5

    def moved(by):
        turn = to_rotation(clip.root_orientation)
        turned = type(turn).from_rotvec(by * clip.root_angular_velocity) * turn
        return clip_motion(
            replace(
                clip,
                cycle=None,
                root_position=clip.root_position + by * clip.root_linear_velocity,
                root_orientation=from_rotation(turned),
                joint_position=clip.joint_position + by * clip.joint_velocity,
            )
        )

    before, after = moved(-step), moved(step)
    count = clip.num_frames
    speed = (after.rows["link_position"] - before.rows["link_position"]) / (2.0 * step)
    np.testing.assert_allclose(motion.rows["link_linear_velocity"][:count], speed, atol=1e-5)
    turning = rotation_between(before.rows["link_orientation"], after.rows["link_orientation"]) / (2.0 * step)
    np.testing.assert_allclose(motion.rows["link_angular_velocity"][:count], turning, atol=1e-5)
    np.testing.assert_allclose(motion.rows["link_position"][:count, 12:], clip.foot_position, atol=1e-9)
    assert set(motion.rows) == set(BODY_ARRAYS)


def test_a_cycle_ends_with_the_first_frame_of_the_next_one(clip):
    motion = clip_motion(clip)
    step = motion.rows["root_position"][-1] - motion.rows["root_position"][0]
    np.testing.assert_allclose(step[:2], [clip.cycle.x, clip.cycle.y], atol=1e-9)
    np.testing.assert_allclose(motion.rows["joint_position"][-1], motion.rows["joint_position"][0], atol=1e-9)
    assert motion.repeats


def test_feet_of_amp_are_those_of_the_joints_in_the_order_of_its_legs(clip, tmp_path):
    (path,) = export_clips([clip], "amp", tmp_path / "out")
    frames = np.array(json.loads(path.read_text())["Frames"])[:-1]
    feet = foot_positions(GO2, clip.joint_position)
    np.testing.assert_allclose(frames[:, 19:31].reshape(-1, 4, 3), feet[:, [1, 0, 3, 2]], atol=1e-9)
    step = 1e-5 * clip.joint_velocity
    moving = (foot_positions(GO2, clip.joint_position + step) - foot_positions(GO2, clip.joint_position - step)) / 2e-5
    np.testing.assert_allclose(frames[:, 49:61].reshape(-1, 4, 3), moving[:, [1, 0, 3, 2]], atol=1e-6)


def test_clips_of_two_licences_go_into_folders_of_their_own(clip, tmp_path):
    other = replace(clip, name="other", origin=replace(clip.origin, licence="CC BY-NC 4.0"))
    files = export_clips([clip, other], "amp", tmp_path / "out")
    assert [path.parent.name for path in files] == ["bsd-3-clause", "cc-by-nc-4.0"]
    assert "- `other`: CC BY-NC 4.0." in (tmp_path / "out" / "README.md").read_text()
    with pytest.raises(ExportError, match="two clips are named"):
        export_clips([clip, clip], "amp", tmp_path / "again")


def test_the_command_writes_clips(clip, tmp_path, capsys):
    clip.save(tmp_path / "trot.npz")
    command = ["motion", "export", str(tmp_path / "trot.npz"), "--format", "unitree", "--out", str(tmp_path / "out")]
    assert main(command) == 0
    assert "1 clip" in capsys.readouterr().out
    header = (tmp_path / "out" / f"{clip.name}.csv").read_text().splitlines()[0]
    assert header.split(",")[:9] == ["time", "x", "y", "z", "qx", "qy", "qz", "qw", "FR_hip_joint"]
    assert main([*command[:-3], "npz", "--out", str(tmp_path / "other")]) == 2
    assert "'npz' is no format of motions" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("form", "change", "message"),
    [
        ("mjlab", {"body_quat_w": None}, "lacks body_quat_w"),
        ("mjlab", {"joint_names": np.array(["a"] * 12)}, "expected FL_hip_joint"),
        ("mjlab", {"body_pos_w": np.zeros((3, 3))}, "a row for each frame and body"),
    ],
)
def test_wrong_arrays_are_named(form, change, message, clip, tmp_path):
    (path,) = export_clips([clip], form, tmp_path / "out")
    with np.load(path) as data:
        arrays = {name: values for name, values in ({**data} | change).items() if values is not None}
    np.savez(path, **arrays)
    with pytest.raises(ClipError, match=message):
        SOURCES["clip"].load(path)


def test_joints_in_another_order_come_back_in_ours(clip, tmp_path):
    (path,) = export_clips([clip], "mjlab", tmp_path / "out")
    with np.load(path) as data:
        arrays = dict(data)
    order = np.arange(12).reshape(4, 3).T.ravel()
    np.savez(path, **arrays | {name: arrays[name][..., order] for name in ("joint_pos", "joint_names")})
    np.testing.assert_allclose(SOURCES["clip"].load(path).points("toe")[:-1], clip.foot_position, atol=1e-6)


def test_files_that_run_code_are_refused(tmp_path):
    torch = pytest.importorskip("torch")
    torch.save({"rigid_body_pos": print}, tmp_path / "evil.motion")
    with pytest.raises(ClipError, match=r"no \.motion that can be read safely"):
        SOURCES["protomotions"].load(tmp_path / "evil.motion")
