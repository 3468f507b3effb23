"""Files of a robot's base and joints: whose they are is found out, and the feet are where kinematics put them."""

import io
import json
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.motions.keypoints import FrameRange
from kine2go_warp.motions.own_file import OwnFile
from kine2go_warp.motions.retarget import retarget
from kine2go_warp.motions.sources import SOURCES
from tests.motions.sources.files import LEGS, RATE, in_order, robot, write_amp, write_frames, write_pickle
from tests.motions.test_fuzz import FUZZ, damage, read_or_refuse

ORDERS = (LEGS, ("FR", "FL", "RR", "RL"), ("RL", "RR", "FL", "FR"))


def feet_in_world(robot_name="go2"):
    """Where forward kinematics puts the feet: here the base only turns about z."""
    position, orientation, _, feet = robot(robot_name)
    yaw = 2.0 * np.arctan2(orientation[:, 2], orientation[:, 3])
    turn = np.stack([np.stack([np.cos(yaw), -np.sin(yaw)], -1), np.stack([np.sin(yaw), np.cos(yaw)], -1)], axis=-2)
    planar = np.einsum("tij,tkj->tki", turn, feet[..., :2])
    return np.concatenate([planar, feet[..., 2:]], axis=-1) + position[:, None]


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("name", ["go2", "a1", "go1"])
def test_robot_and_order_of_legs_are_told_by_the_columns_of_feet(tmp_path, name, order):
    motion = SOURCES["amp"].load(write_amp(tmp_path / "trot.txt", name, order, shift=0.012))
    assert motion.notes[0].startswith(f"joints of {name}, legs {' '.join(order)}, 0.0 mm from its columns of feet")
    size = {"go2": 1.0, "go1": 1.0, "a1": 0.426 / 0.4}[name]
    np.testing.assert_allclose(motion.points("toe"), size * feet_in_world(name), atol=1e-9)
    assert motion.rate == pytest.approx(RATE)


def test_feet_that_fit_no_robot_are_refused(tmp_path):
    path = write_amp(tmp_path / "trot.txt")
    content = json.loads(path.read_text())
    for row in content["Frames"]:
        row[19:31] = [1.4 * value for value in row[19:31]]
    path.write_text(json.dumps(content))
    with pytest.raises(ClipError, match="fit the joints of none of go2, a1, go1, in no order of the legs"):
        SOURCES["amp"].load(path)


def test_opposite_signs_turned_bases_and_rotation_vectors_lead_to_the_same_feet(tmp_path):
    position, orientation, joints, _ = robot()
    base = [position, orientation]
    opposite = in_order(joints * [1.0, -1.0, -1.0], ("FR", "FL", "RR", "RL"))
    mirrored = write_frames(
        tmp_path / "max.txt", np.concatenate([*base, opposite], axis=1), LegOrder=["FR", "FL", "HR", "HL"]
    )
    plain = write_frames(tmp_path / "joints.txt", np.concatenate([*base, joints.reshape(-1, 12)], axis=1))
    arrays = tmp_path / "export.npz"
    np.savez(
        arrays,
        root_position=position,
        root_orientation=np.roll(orientation, 1, axis=1),
        joint_position=joints.reshape(-1, 12),
        time=np.arange(len(position)) / RATE,
    )
    expected = feet_in_world()
    for name, path in (("joints", plain), ("clip", arrays), ("mimickit", write_pickle(tmp_path / "walk.pkl"))):
        np.testing.assert_allclose(SOURCES[name].load(path).points("toe"), expected, atol=1e-9)
    # The robot MAX has other legs, so only the directions can be compared: feet below the hips, knees bent backwards.
    toes = SOURCES["max"].load(mirrored).points("toe")
    np.testing.assert_array_equal(np.sign(toes[..., 1]), np.sign(expected[..., 1]))
    with pytest.raises(ClipError, match="the knees bend forward"):
        SOURCES["joints"].load(mirrored)


def test_a_clip_comes_back_as_it_was(tmp_path, solver, clip):
    clip.save(tmp_path / "again.npz")
    entry = OwnFile(tmp_path / "again.npz", licence="own").entry()
    again = retarget(entry, None, solver, RetargetConfig(search_time=0.0, smoothing=0.0)).clip
    assert entry.source == "clip"
    assert np.sqrt(np.mean((again.joint_position - clip.joint_position) ** 2)) < 0.02
    assert np.abs(again.foot_position - clip.foot_position).max() < 0.02


def test_slip_and_depth_of_the_file_are_told_beside_those_of_the_clip(tmp_path, solver):
    position, orientation, joints, _ = robot()
    position = position - [0.0, 0.0, 0.006]
    rows = np.concatenate([position, orientation, joints.reshape(-1, 12)], axis=1)
    path = write_frames(tmp_path / "trot.txt", rows)
    entry = OwnFile(path, licence="own", frames=FrameRange(5, 30)).entry()
    fidelity = retarget(entry, None, solver, RetargetConfig(search_time=0.0)).clip.fidelity
    assert fidelity.source_penetration == pytest.approx(0.006, abs=1e-6)
    assert fidelity.penetration < 1e-3
    feet = feet_in_world()[5:30]
    speed = RATE * np.linalg.norm(np.gradient(feet[..., :2], axis=0), axis=-1)
    low = np.sort(speed[feet[..., 2] < 0.022 + 0.009])
    assert low[0] < fidelity.source_standing_speed < low[-1]
    assert fidelity.standing_speed < fidelity.source_standing_speed


class Attack:
    def __reduce__(self):
        return print, ("run",)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"fps": RATE, "frames": Attack()}, r"asks for builtins\.print, which a file of numbers does not need"),
        ({"fps": RATE, "frames": [[0.0] * 18, [0.0] * 17, [0.0] * 18]}, "frame 1: not the 18 numbers"),
        (
            {"fps": RATE, "frames": [[0.0] * 18, ["x"] * 18, [0.0] * 18]},
            "frame 1: holds something that is not a number",
        ),
        ({"fps": RATE, "frames": [[0.0] * 18, [np.inf] * 18, [0.0] * 18]}, "frame 1: column 0 is not finite"),
        ({"fps": 0, "frames": [[0.0] * 18] * 3}, "a rate of 0 Hz; 1 to 1000 Hz can be used"),
        ({"frames": [[0.0] * 18] * 3}, "fps is None"),
        ([1, 2], "a pickle without 'frames'"),
    ],
)
def test_pickles_are_read_without_running_anything(tmp_path, capsys, content, message):
    path = write_pickle(tmp_path / "walk.pkl", content)
    with pytest.raises(ClipError, match=message):
        SOURCES["mimickit"].load(path)
    assert capsys.readouterr().out == ""


def test_a_pickle_of_arrays_is_one_of_lists(tmp_path):
    lists = pickle.loads(write_pickle(tmp_path / "walk.pkl").read_bytes())
    arrays = write_pickle(tmp_path / "arrays.pkl", {**lists, "frames": np.array(lists["frames"])})
    one, other = (SOURCES["mimickit"].load(tmp_path / name) for name in ("walk.pkl", arrays.name))
    np.testing.assert_array_equal(one.position, other.position)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"joint_position": np.full((60, 12), "0.5")}, "holds something else than numbers"),
        ({"joint_position": np.zeros((60, 8))}, r"joint_position \(60, 8\)"),
        ({"joint_position": np.full((60, 12), -86.0)}, "are the file's angles in degrees"),
        ({"root_orientation": np.zeros((60, 4))}, "frame 0: the orientation is no unit quaternion"),
        ({"root_orientation": np.tile([0.5, 0.5, 0.5, 0.5], (60, 1))}, "does not stand upright"),
        ({"time": np.zeros(60)}, "time stamps do not rise"),
        ({"time": None}, "tells no rate"),
        ({"time": None, "header": json.dumps({"frame_duration": 0})}, "a frame duration of 0"),
        ({"root_position": None}, "lacks root_position"),
    ],
)
def test_wrong_arrays_are_named(tmp_path, change, message):
    position, orientation, joints, _ = robot()
    arrays = {
        "root_position": position,
        "root_orientation": np.roll(orientation, 1, axis=1),
        "joint_position": joints.reshape(-1, 12),
        "time": np.arange(len(position)) / RATE,
    } | change
    np.savez(tmp_path / "walk.npz", **{name: array for name, array in arrays.items() if array is not None})
    with pytest.raises(ClipError, match=message):
        SOURCES["clip"].load(tmp_path / "walk.npz")


@FUZZ
@given(data=st.data())
def test_damaged_json_is_read_or_refused(tmp_path, data):
    path = tmp_path / "trot.txt"
    text = write_amp(path).read_text()
    path.write_text(data.draw(damage(text)), encoding="utf-8", errors="surrogatepass")
    read_or_refuse(SOURCES["amp"], path)


@FUZZ
@given(data=st.data())
def test_damaged_pickles_are_read_or_refused(tmp_path, data):
    path = write_pickle(tmp_path / "walk.pkl")
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(bytes(content))
    read_or_refuse(SOURCES["mimickit"], path)


@FUZZ
@given(data=st.data())
def test_damaged_archives_are_read_or_refused(tmp_path, data):
    position, orientation, joints, _ = robot()
    buffer = io.BytesIO()
    arrays = {"root_position": position, "root_orientation": orientation, "joint_position": joints.reshape(-1, 12)}
    np.savez(buffer, **arrays, time=np.arange(len(position)) / RATE)
    content = bytearray(buffer.getvalue())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path / "export.npz"
    path.write_bytes(bytes(content))
    read_or_refuse(SOURCES["clip"], path)


def test_a_saved_clip_tells_its_robot_and_rate(clip, tmp_path):
    clip.save(tmp_path / "clip.npz")
    motion = SOURCES["clip"].load(tmp_path / "clip.npz")
    assert MotionClip.load(tmp_path / "clip.npz").frame_duration == pytest.approx(1.0 / motion.rate)
    assert motion.notes == ("joints of go2, legs FL FR RL RR",)
