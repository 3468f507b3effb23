"""Solo8: a tensor in its layout, made by placo's forward kinematics of a known gait."""

import numpy as np
import placo
import pytest
import torch
from scipy.spatial.transform import Rotation

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.sources import Solo8
from kine2go_warp.motions.sources.solo8 import LEG_PREFIXES, URDF, leg_points

JOINTS = [f"{leg}_{joint}" for leg in LEG_PREFIXES for joint in ("HFE", "KFE")]


def trot(num_frames=120, speed=0.5):
    """A trot in joint space; rear knees bend the other way."""
    phase = 2.0 * np.pi * np.arange(num_frames) / 25.0
    rows = np.zeros((num_frames, 33))
    rows[:, 0] = speed * np.arange(num_frames) / 50.0
    rows[:, 2] = 0.24
    rows[:, 3:7] = Rotation.from_rotvec([0.0, 0.05, 0.2]).as_quat()
    for index in range(4):
        swing = phase + (0.0 if index in (0, 3) else np.pi)
        bend = 1.0 if index < 2 else -1.0
        rows[:, 17 + 2 * index] = bend * 0.7 + 0.25 * np.sin(swing)
        rows[:, 18 + 2 * index] = -bend * (1.4 + 0.2 * np.maximum(np.cos(swing), 0.0))
    rows[:, 25:33] = 50.0 * np.gradient(rows[:, 17:25], axis=0)
    return rows


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "solo8_motion_data.pt"
    torch.save(torch.tensor(np.stack([trot(), trot(speed=0.8)]), dtype=torch.float32), path)
    return path


def test_keypoints_agree_with_placos_forward_kinematics(file):
    motion = Solo8().read(file.with_name(file.name + ":1"))
    rows = np.float64(np.float32(trot(speed=0.8)))
    robot = placo.RobotWrapper(str(URDF), placo.Flags.ignore_collisions)
    for frame in (0, 7, 50, 119):
        base = np.eye(4)
        base[:3, :3] = Rotation.from_quat(rows[frame, 3:7]).as_matrix()
        base[:3, 3] = rows[frame, :3]
        robot.set_T_world_fbase(base)
        for joint, value in zip(JOINTS, rows[frame, 17:25], strict=True):
            robot.set_joint(joint, value)
        robot.update_kinematics()
        expected = [robot.get_T_world_frame(f"{leg}_foot")[:3, 3] for leg in LEG_PREFIXES]
        np.testing.assert_allclose(motion.points("toe")[frame], expected, atol=1e-6)
        hips = [robot.get_T_world_frame(f"{leg}_upper_leg")[:3, 3] for leg in LEG_PREFIXES]
        np.testing.assert_allclose(motion.points("hip")[frame], hips, atol=1e-6)


def test_rate_speed_and_trunk(file):
    motion = Solo8().read(file.with_name(file.name + ":0"))
    assert motion.rate == pytest.approx(50.0)
    middle = 0.5 * (motion.point("neck") + motion.point("pelvis"))
    np.testing.assert_allclose(middle, np.float32(trot())[:, :3], atol=1e-6)
    assert np.linalg.norm(middle[-1] - middle[0]) / motion.time[-1] == pytest.approx(0.5, rel=1e-3)


def test_a_file_of_another_rate_is_told_by_its_own_velocities(tmp_path):
    rows = trot()
    rows[:, 25:33] *= 2.0
    torch.save(torch.tensor(rows[None]), tmp_path / "solo8.pt")
    with pytest.raises(ClipError, match=r"fit 9\d frames a second, not 50"):
        Solo8().read(tmp_path / "solo8.pt:0")


def test_knees_bend_as_in_the_robot():
    _, feet = leg_points(trot()[:, 17:25])
    # With the upper leg forward at 0.7 rad the foot hangs near below the hip in front, likewise behind.
    assert np.all(np.abs(feet[:, :2, 0] - 0.19) < 0.12)
    assert np.all(np.abs(feet[:, 2:, 0] + 0.19) < 0.12)
    assert np.all(feet[..., 2] < -0.2)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("solo8_motion_data.pt", "name a trajectory"),
        ("solo8_motion_data.pt:x", "name a trajectory|no such"),
        ("solo8_motion_data.pt:2", "no trajectory 2; it holds 2"),
        ("missing.pt:0", "no such motion file"),
    ],
)
def test_a_wrong_name_is_refused(file, name, message):
    with pytest.raises(ClipError, match=message):
        Solo8().read(file.with_name(name))


class Trap:
    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (str(self.path), "w")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (torch.zeros(3, 4), "of shape"),
        (torch.zeros(1, 2, 33), "of shape"),
        ({"weights": torch.zeros(2, 10, 33)}, "holds dict"),
        (torch.zeros(2, 10, 33, dtype=torch.int64), "of real numbers"),
        (torch.zeros(2, 10, 33), "unit quaternions"),
        (torch.full((2, 10, 33), float("nan")), "finite"),
    ],
    ids=["flat", "short", "dictionary", "integers", "zeros", "nan"],
)
def test_a_file_of_something_else_is_refused(tmp_path, content, message):
    torch.save(content, tmp_path / "solo8.pt")
    with pytest.raises(ClipError, match=message):
        Solo8().read(tmp_path / "solo8.pt:0")


def test_a_pickle_is_not_run_and_damage_is_named(tmp_path):
    torch.save(Trap(tmp_path / "sprung"), tmp_path / "solo8.pt")
    with pytest.raises(ClipError, match="safely"):
        Solo8().read(tmp_path / "solo8.pt:0")
    assert not (tmp_path / "sprung").exists()
    (tmp_path / "solo8.pt").write_bytes(b"PK\x03\x04")
    with pytest.raises(ClipError):
        Solo8().read(tmp_path / "solo8.pt:0")
    (tmp_path / "folder.pt").mkdir()
    with pytest.raises(ClipError, match="folder"):
        Solo8().read(tmp_path / "folder.pt:0")
