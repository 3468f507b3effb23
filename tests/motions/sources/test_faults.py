"""Every fault that a recording can have, in a file of every format: repaired with a remark, or refused with its place.

``tests/motions/test_examination.py`` has the faults in detail; here each reader delivers them to it.
"""

import io
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.generator import DogGait, generate, write_ai4animation
from kine2go_warp.motions.keypoints import KEYPOINTS, KeypointMotion
from kine2go_warp.motions.sources import SOURCES, MotionSource, source_of
from kine2go_warp.motions.sources.ai4animation import COLUMN_OF_KEYPOINT
from kine2go_warp.motions.sources.dialects import PointsDialect
from kine2go_warp.motions.sources.joints import JointSource
from kine2go_warp.robots import GO2
from kine2go_warp.robots.kinematics import foot_positions
from tests.motions.sources.files import (
    AI4ANIMATION_PARENTS,
    RATE,
    ai4animation_points,
    in_order,
    robot,
    write_bvh,
    write_frames,
    write_pickle,
)
from tests.motions.sources.test_points import write_c3d, write_csv
from tests.motions.test_fuzz import FUZZ, damage, read_or_refuse
from tests.motions.test_vhdc import write as write_vhdc

NUM_FRAMES = 180
COLUMNS = [COLUMN_OF_KEYPOINT[name] for name in KEYPOINTS]
MINE = PointsDialect("table", {name: name for name in KEYPOINTS}, 0.825, 0.04, 0.04, 0.1, up="z", time="time")
HORSE = 3.0
"""Its size over that of the dog."""
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


def write_horse(path, points):
    """Three times the dog on a treadmill that cancels its speed: a horse's markers in millimetres."""
    horse = HORSE * points
    belt = (HORSE * DogGait().speed * TIME)[:, None, None] * [1.0, 0.0, 0.0]
    horse = np.where(points.any(axis=-1, keepdims=True), horse - belt, 0.0)
    names = ("neck", "neck", "pelvis", "FL_toe", "FR_toe", "RL_toe", "RR_toe")
    write_vhdc(path, TIME, 1e3 * horse[:, [COLUMN_OF_KEYPOINT[name] for name in names]])


ANIMALS: dict[str, tuple[MotionSource, Callable[[Path, np.ndarray], object]]] = {
    "text": (SOURCES["ai4animation"], lambda path, points: write_ai4animation(points, path)),
    "bvh": (
        SOURCES["ai4animation_bvh"],
        lambda path, points: write_bvh(path, ai4animation_points(points), AI4ANIMATION_PARENTS),
    ),
    "csv": (source_of("mine", MINE), lambda path, points: write_csv(path, columns_of(points))),
    "parquet": (source_of("mine", MINE), write_parquet),
    "npz": (source_of("mine", replace(MINE, format="arrays")), write_points),
    "vhdc": (SOURCES["vhdc"], write_horse),
    "c3d": (
        source_of("mine", replace(MINE, format="c3d", time="")),
        lambda path, points: write_c3d(path, points[:, COLUMNS]),
    ),
}
"""The generated dog, whose 27 points are in metres with z up, in each format of points."""
SUFFIX = {"parquet": ".parquet", "c3d": ".c3d"}


HOOF = {"FL_toe": "HFL", "RR_toe": "HHR"}
"""Names of the horse's file for the points that are spoilt here."""


def told(name: str, toe: str) -> str:
    return HOOF[toe] if name == "vhdc" else toe


def error_of(name: str, motion: KeypointMotion, good: KeypointMotion) -> float:
    """Return the largest distance along an axis between two motions, in the size of the dog [m]."""
    return np.abs(motion.position - good.position).max() / (HORSE if name == "vhdc" else 1.0)


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
    assert motion.remarks == (f"{told(animal, 'FL_toe')} jumps in frame 45, filled",)
    assert error_of(animal, motion, loaded(animal, tmp_path, points)) < 0.03


def test_swapped_toes_are_put_right(animal, points, tmp_path):
    bad, toes = points.copy(), [COLUMN_OF_KEYPOINT[f"{leg}_toe"] for leg in ("FL", "FR")]
    bad[45:66, toes] = bad[45:66, toes[::-1]]
    motion = loaded(animal, tmp_path, bad)
    assert motion.remarks
    assert error_of(animal, motion, loaded(animal, tmp_path, points)) < 0.03


@pytest.mark.parametrize("name", [name for name in ANIMALS if name != "bvh"])
def test_a_marker_written_as_zeros_is_filled(name, points, tmp_path):
    bad = points.copy()
    bad[70:76, COLUMN_OF_KEYPOINT["RR_toe"]] = 0.0
    motion = loaded(name, tmp_path, bad)
    assert motion.remarks == (f"{told(name, 'RR_toe')} all zeros in frames 70 to 75, filled",)
    assert error_of(name, motion, loaded(name, tmp_path, points)) < 0.04


@pytest.mark.parametrize("name", ["parquet", "npz", "c3d"])
def test_a_marker_that_is_not_finite_is_filled(name, points, tmp_path):
    bad = points.copy()
    bad[70:76, COLUMN_OF_KEYPOINT["RR_toe"]] = np.nan
    assert loaded(name, tmp_path, bad).remarks == ("RR_toe not finite in frames 70 to 75, filled",)


@pytest.mark.parametrize("name", ["text", "bvh", "csv", "vhdc"])
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
    expected = {"bvh": "likely in (metres|feet)", "vhdc": "not in millimetres"}.get(animal, f"likely in {unit}")
    with pytest.raises(ClipError, match=expected):
        loaded(animal, tmp_path, points / factor if animal == "bvh" else factor * points)


def test_mirrored_animals_are_refused(animal, points, tmp_path):
    with pytest.raises(ClipError, match="the left feet are on the right"):
        loaded(animal, tmp_path, points * [1.0, -1.0, 1.0])


@pytest.mark.parametrize("name", ["text", "bvh", "csv", "vhdc"])
@pytest.mark.parametrize("how", ["utf-8-sig", "utf-16", "windows line ends"])
def test_other_ways_to_save_text_change_nothing(name, how, points, tmp_path):
    source, write = ANIMALS[name]
    path = tmp_path / "dog.dat"
    write(path, points)
    good, text = source.load(path), path.read_text()
    path.write_bytes(text.replace("\n", "\r\n").encode() if how.startswith("windows") else text.encode(how))
    np.testing.assert_array_equal(source.load(path).position, good.position)


@pytest.mark.parametrize("name", ["csv", "npz"])
def test_a_file_without_time_stamps_has_the_stated_rate(name, points, tmp_path):
    source, write = ANIMALS[name]
    write(tmp_path / "dog.dat", points)
    stated = source_of("mine", replace(source.dialect, time="", rate=30.0))
    assert stated.load(tmp_path / "dog.dat").rate == pytest.approx(30.0)
    with pytest.raises(ClipError, match="tells no rate"):
        source_of("mine", replace(source.dialect, time="")).load(tmp_path / "dog.dat")


OTHER_ORDER = ("FR", "FL", "RR", "RL")


def feet_of(joints) -> np.ndarray:
    return foot_positions(GO2, joints.reshape(-1, 12)).reshape(-1, 12)


def table_text(names: list[str], rows: np.ndarray) -> str:
    return "\n".join([",".join(names), *(",".join(f"{value:.9g}" for value in row) for row in rows)]) + "\n"


def frames_of(name: str, position, rotation, joints) -> np.ndarray:
    """Return the rows of a file of JSON, of a robot's motion with joints of shape [num_frames, 4, 3]."""
    if name == "max":
        return np.concatenate([position, rotation.as_quat(), in_order(joints * [1.0, -1.0, -1.0], OTHER_ORDER)], axis=1)
    if name == "laikago":
        theirs = joints - [0.0, 0.5988, -0.5110]
        theirs[:, 1::2, 0] *= -1.0
        turned = (rotation * Rotation.from_quat([0.5, 0.5, 0.5, 0.5])).as_quat()
        return np.concatenate([position, turned, in_order(theirs, OTHER_ORDER)], axis=1)
    more = [feet_of(joints), np.zeros((len(position), 30))] if name == "amp" else []
    return np.concatenate([position, rotation.as_quat(), joints.reshape(-1, 12), *more], axis=1)


def robot_file(folder: Path, name: str, position, rotation, joints) -> Path:
    """Write a robot's motion in one of the formats of joints."""
    path, flat = folder / "trot.dat", joints.reshape(-1, 12)
    if name in ("joints", "max", "laikago", "amp"):
        legs = {"LegOrder": ["FR", "FL", "HR", "HL"]} if name == "max" else {}
        return write_frames(path, frames_of(name, position, rotation, joints), **legs)
    if name == "mimickit":
        rows = np.concatenate([position, rotation.as_rotvec(), flat], axis=1)
        return write_pickle(path, {"fps": RATE, "frames": rows.tolist()})
    if name == "humanoidverse":
        motion = {"root_trans_offset": position, "root_rot": rotation.as_quat(), "dof": flat, "fps": RATE}
        return write_pickle(path, {"trot": motion})
    if name == "protomotions":
        base = {"rigid_body_pos": position[:, None], "rigid_body_rot": rotation.as_quat()[:, None], "dof_pos": flat}
        torch.save({**{key: torch.tensor(values) for key, values in base.items()}, "fps": RATE}, path)
        return path
    if name == "clip":
        with path.open("wb") as file:
            orientation, time = rotation.as_quat(scalar_first=True), np.arange(len(position)) / RATE
            np.savez(file, root_position=position, root_orientation=orientation, joint_position=flat, time=time)
        return path
    dialect = SOURCES[name].dialect
    names = [*dialect.position, *dialect.orientation, *dialect.joints, *dialect.toes]
    rows = [position, rotation.as_quat(), flat, *([feet_of(joints)] if dialect.toes else [])]
    path.write_text(table_text(names, np.concatenate(rows, axis=1)))
    return path


def solo8_file(folder: Path, position, rotation, joints) -> Path:
    """Write the same motion as if it were Solo8's, which has no hips that turn outwards."""
    rows = np.zeros((len(position), 33))
    rows[:, :3], rows[:, 3:7], rows[:, 17:25] = position, rotation.as_quat(), joints[..., 1:].reshape(-1, 8)
    rows[:, 25:33] = np.nan_to_num(RATE * np.gradient(rows[:, 17:25], axis=0))
    torch.save(torch.tensor(rows[None]), folder / "solo8.pt")
    return folder / "solo8.pt:0"


ROBOTS = (
    *("joints", "max", "laikago", "amp", "mimickit", "humanoidverse", "protomotions"),
    *("apex", "joint_table", "clip", "solo8"),
)


@pytest.fixture(params=ROBOTS)
def read_robot(request, tmp_path):
    """A function that writes a robot's motion in a format, and reads it."""
    name = request.param

    def read(position, rotation, joints) -> KeypointMotion:
        if name == "solo8":
            return SOURCES[name].load(solo8_file(tmp_path, position, rotation, joints))
        source = SOURCES[name]
        if name == "joint_table":
            source = source_of("mine", replace(source.dialect, rate=RATE))
        return source.load(robot_file(tmp_path, name, position, rotation, joints))

    read.name = name
    return read


def trot(num_frames=100):
    position, orientation, joints, _ = robot(num_frames=num_frames)
    return position, Rotation.from_quat(orientation), joints


def test_every_format_of_joints_is_among_these():
    assert {name for name in SOURCES if isinstance(SOURCES[name], JointSource)} - {"apex_wide"} < set(ROBOTS)


def test_a_robots_motion_has_no_remarks(read_robot):
    assert read_robot(*trot()).remarks == ()


def test_a_robots_glitch_is_repaired_and_named(read_robot):
    position, rotation, joints = trot()
    good = read_robot(position, rotation, joints)
    joints = joints.copy()
    joints[40, 2] += [0.4, 0.6, -0.5]
    motion = read_robot(position, rotation, joints)
    assert motion.remarks == ("RL_toe jumps in frame 40, filled",)
    assert np.abs(motion.position - good.position).max() < 0.02


def test_a_robots_tilted_floor_is_levelled(read_robot):
    position, rotation, joints = trot(400)
    tilt = Rotation.from_euler("y", 2.0, degrees=True)
    (remark,) = read_robot(tilt.apply(position), tilt * rotation, joints).remarks
    assert "the floor rose by 2.0 degrees" in remark


SEVENTH = np.arange(60)[:, None, None] == 7


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda position, joints: (position, np.degrees(joints)), "are the file's angles in degrees"),
        (lambda position, joints: (position, np.where(SEVENTH, np.nan, joints)), "frame 7|line 9"),
        (lambda position, joints: (1e8 + position, joints), "frame 0|line 2"),
        (lambda position, joints: (100.0 * position, joints), "likely in centimetres"),
    ],
    ids=["degrees", "not finite", "out of all bounds", "centimetres"],
)
def test_a_robots_wrong_numbers_are_refused(read_robot, change, message):
    position, rotation, joints = trot(60)
    position, joints = change(position, joints)
    with pytest.raises(ClipError, match=message):
        read_robot(position, rotation, joints)


@pytest.mark.parametrize("how", ["utf-8-sig", "utf-16", "windows line ends"])
@pytest.mark.parametrize("name", ["joints", "max", "laikago", "amp", "apex"])
def test_other_ways_to_save_a_robots_text_change_nothing(name, how, tmp_path):
    path = robot_file(tmp_path, name, *trot(60))
    good = SOURCES[name].load(path)
    text = path.read_text()
    path.write_bytes(text.replace("\n", "\r\n").encode() if how.startswith("windows") else text.encode(how))
    np.testing.assert_array_equal(SOURCES[name].load(path).position, good.position)


@FUZZ
@given(data=st.data(), name=st.sampled_from(["joints", "max", "laikago", "apex"]))
def test_a_robots_damaged_text_is_read_or_refused(tmp_path, data, name):
    path = robot_file(tmp_path, name, *trot(12))
    path.write_text(data.draw(damage(path.read_text())), encoding="utf-8", errors="surrogatepass")
    read_or_refuse(SOURCES[name], path)
