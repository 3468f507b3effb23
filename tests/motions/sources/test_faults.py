"""Every fault that a recording can have, in a file of every format: repaired with a remark, or refused with its place.

``tests/motions/test_examination.py`` has the faults in detail; here each reader delivers them to it.
"""

import io
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.generator import DogGait, generate, write_ai4animation
from kine2go_warp.motions.keypoints import KEYPOINTS, KeypointMotion
from kine2go_warp.motions.sources import SOURCES, MotionSource, source_of
from kine2go_warp.motions.sources.ai4animation import COLUMN_OF_KEYPOINT
from kine2go_warp.motions.sources.dialects import PointsDialect
from tests.motions.sources.files import (
    AI4ANIMATION_PARENTS,
    RATE,
    ai4animation_points,
    robot,
    write_bvh,
    write_frames,
    write_pickle,
)
from tests.motions.sources.test_points import write_c3d, write_csv

NUM_FRAMES = 180
COLUMNS = [COLUMN_OF_KEYPOINT[name] for name in KEYPOINTS]
MINE = PointsDialect("table", {name: name for name in KEYPOINTS}, 0.825, 0.04, 0.04, 0.1, up="z", time="time")
TIME = np.arange(NUM_FRAMES) / 60.0


def columns_of(points):
    return {"time": TIME} | {
        f"{name}_{axis}": points[:, COLUMN_OF_KEYPOINT[name], i] for name in KEYPOINTS for i, axis in enumerate("xyz")
    }


def write_parquet(path, points):
    pyarrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    parquet.write_table(pyarrow.table(columns_of(points)), path)


def write_points(path, points):
    arrays = {name: points[:, COLUMN_OF_KEYPOINT[name]] for name in KEYPOINTS}
    buffer = io.BytesIO()
    np.savez(buffer, time=TIME, **arrays)
    path.write_bytes(buffer.getvalue())


ANIMALS: dict[str, tuple[MotionSource, Callable[[Path, np.ndarray], object]]] = {
    "text": (SOURCES["ai4animation"], lambda path, points: write_ai4animation(points, path)),
    "bvh": (
        SOURCES["ai4animation_bvh"],
        lambda path, points: write_bvh(path, ai4animation_points(points), AI4ANIMATION_PARENTS),
    ),
    "csv": (source_of("mine", MINE), lambda path, points: write_csv(path, columns_of(points))),
    "parquet": (source_of("mine", MINE), write_parquet),
    "npz": (source_of("mine", replace(MINE, format="arrays")), write_points),
    "c3d": (
        source_of("mine", replace(MINE, format="c3d", time="")),
        lambda path, points: write_c3d(path, points[:, COLUMNS]),
    ),
}
"""The generated dog, whose 27 points are in metres with z up, in each format of points."""
SUFFIX = {"parquet": ".parquet", "c3d": ".c3d"}


def loaded(name: str, folder: Path, points: np.ndarray) -> KeypointMotion:
    source, write = ANIMALS[name]
    path = folder / f"dog{SUFFIX.get(name, '.dat')}"
    write(path, points)
    return source.load(path)


@pytest.fixture(scope="module")
def points():
    return generate(DogGait(), NUM_FRAMES).points


@pytest.fixture(params=ANIMALS)
def animal(request):
    return request.param


def test_a_glitch_is_repaired_and_named(animal, points, tmp_path):
    bad = points.copy()
    bad[45, COLUMN_OF_KEYPOINT["FL_toe"]] += [0.4, 0.1, 0.3]
    motion = loaded(animal, tmp_path, bad)
    assert motion.remarks == ("FL_toe jumps in frame 45, filled",)
    assert np.abs(motion.position - points[:, COLUMNS]).max() < 0.03


def test_swapped_toes_are_put_right(animal, points, tmp_path):
    bad, toes = points.copy(), [COLUMN_OF_KEYPOINT[f"{leg}_toe"] for leg in ("FL", "FR")]
    bad[45:66, toes] = bad[45:66, toes[::-1]]
    motion = loaded(animal, tmp_path, bad)
    assert motion.remarks
    assert np.abs(motion.position - points[:, COLUMNS]).max() < 0.03


@pytest.mark.parametrize("name", [name for name in ANIMALS if name != "bvh"])
def test_a_marker_written_as_zeros_is_filled(name, points, tmp_path):
    bad = points.copy()
    bad[70:76, COLUMN_OF_KEYPOINT["RR_toe"]] = 0.0
    motion = loaded(name, tmp_path, bad)
    assert motion.remarks == ("RR_toe all zeros in frames 70 to 75, filled",)
    assert np.abs(motion.position - points[:, COLUMNS]).max() < 0.04


@pytest.mark.parametrize("name", ["parquet", "npz", "c3d"])
def test_a_marker_that_is_not_finite_is_filled(name, points, tmp_path):
    bad = points.copy()
    bad[70:76, COLUMN_OF_KEYPOINT["RR_toe"]] = np.nan
    assert loaded(name, tmp_path, bad).remarks == ("RR_toe not finite in frames 70 to 75, filled",)


@pytest.mark.parametrize("name", ["text", "bvh", "csv"])
def test_text_that_is_not_finite_is_refused_with_its_line(name, points, tmp_path):
    bad = points.copy()
    bad[70, COLUMN_OF_KEYPOINT["RR_toe"]] = np.nan
    with pytest.raises(ClipError, match=r"dog\.dat, line \d+: .*not finite"):
        loaded(name, tmp_path, bad)


def test_frames_that_a_skeletons_recorder_missed_are_filled(points, tmp_path):
    bad = points.copy()
    bad[70:76] = 0.0
    motion = loaded("bvh", tmp_path, bad)
    assert "pelvis not finite in frames 70 to 75, filled" in motion.remarks
    assert np.abs(motion.position - points[:, COLUMNS]).max() < 0.05


def test_a_tilted_floor_is_levelled(animal, points, tmp_path):
    tilted = Rotation.from_euler("y", 2.0, degrees=True).apply(points.reshape(-1, 3)).reshape(points.shape)
    (remark,) = loaded(animal, tmp_path, tilted).remarks
    assert "the floor rose by 2.0 degrees" in remark


@pytest.mark.parametrize(("factor", "unit"), [(100.0, "centimetres"), (39.37, "inches")])
def test_another_unit_is_named(animal, points, tmp_path, factor, unit):
    # The BVH of AI4Animation is in centimetres.
    expected = "metres|feet" if animal == "bvh" else unit
    with pytest.raises(ClipError, match=rf"likely in ({expected})"):
        loaded(animal, tmp_path, points / factor if animal == "bvh" else factor * points)


def test_mirrored_animals_are_refused(animal, points, tmp_path):
    with pytest.raises(ClipError, match="the left feet are on the right"):
        loaded(animal, tmp_path, points * [1.0, -1.0, 1.0])


@pytest.mark.parametrize("name", ["text", "bvh", "csv"])
@pytest.mark.parametrize("how", ["utf-8-sig", "utf-16", "windows line ends"])
def test_other_ways_to_save_text_change_nothing(name, how, points, tmp_path):
    source, write = ANIMALS[name]
    path = tmp_path / "dog.dat"
    write(path, points)
    text = path.read_text()
    path.write_bytes(text.replace("\n", "\r\n").encode() if how.startswith("windows") else text.encode(how))
    np.testing.assert_allclose(source.load(path).position, points[:, COLUMNS], atol=2e-5)


@pytest.mark.parametrize("name", ["csv", "npz"])
def test_a_file_without_time_stamps_has_the_stated_rate(name, points, tmp_path):
    source, write = ANIMALS[name]
    write(tmp_path / "dog.dat", points)
    stated = source_of("mine", replace(source.dialect, time="", rate=30.0))
    assert stated.load(tmp_path / "dog.dat").rate == pytest.approx(30.0)
    with pytest.raises(ClipError, match="tells no rate"):
        source_of("mine", replace(source.dialect, time="")).load(tmp_path / "dog.dat")


def robot_rows(folder: Path, name: str, position, rotation, joints) -> Path:
    """Write the robot's motion in one of the formats of joints."""
    quaternion, flat = rotation.as_quat(), joints.reshape(-1, 12)
    if name == "joints":
        return write_frames(folder / "trot.dat", np.concatenate([position, quaternion, flat], axis=1))
    if name == "mimickit":
        rows = np.concatenate([position, rotation.as_rotvec(), flat], axis=1)
        return write_pickle(folder / "trot.dat", {"fps": RATE, "frames": rows.tolist()})
    buffer = io.BytesIO()
    arrays = {"root_position": position, "root_orientation": np.roll(quaternion, 1, axis=1), "joint_position": flat}
    np.savez(buffer, time=np.arange(len(position)) / RATE, **arrays)
    (folder / "trot.dat").write_bytes(buffer.getvalue())
    return folder / "trot.dat"


ROBOTS = ("joints", "mimickit", "clip")


@pytest.mark.parametrize("name", ROBOTS)
def test_a_robots_glitch_is_repaired_and_named(name, tmp_path):
    position, orientation, joints, _ = robot(num_frames=100)
    good = SOURCES[name].load(robot_rows(tmp_path, name, position, Rotation.from_quat(orientation), joints))
    joints = joints.copy()
    joints[40, 2] += [0.4, 0.6, -0.5]
    motion = SOURCES[name].load(robot_rows(tmp_path, name, position, Rotation.from_quat(orientation), joints))
    assert motion.remarks == ("RL_toe jumps in frame 40, filled",)
    assert np.abs(motion.position - good.position).max() < 0.02


@pytest.mark.parametrize("name", ROBOTS)
def test_a_robots_tilted_floor_is_levelled(name, tmp_path):
    position, orientation, joints, _ = robot(num_frames=400)
    tilt = Rotation.from_euler("y", 2.0, degrees=True)
    path = robot_rows(tmp_path, name, tilt.apply(position), tilt * Rotation.from_quat(orientation), joints)
    (remark,) = SOURCES[name].load(path).remarks
    assert "the floor rose by 2.0 degrees" in remark


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda position, joints: (position, np.degrees(joints)), "are the file's angles in degrees"),
        (lambda position, joints: (position, np.where(np.arange(60)[:, None, None] == 7, np.nan, joints)), "frame 7"),
        (lambda position, joints: (1e8 + position, joints), "frame 0"),
    ],
    ids=["degrees", "not finite", "out of all bounds"],
)
def test_a_robots_wrong_numbers_are_refused(name, change, message, tmp_path):
    position, orientation, joints, _ = robot()
    position, joints = change(position, joints)
    path = robot_rows(tmp_path, name, position, Rotation.from_quat(orientation), joints)
    with pytest.raises(ClipError, match=message):
        SOURCES[name].load(path)
