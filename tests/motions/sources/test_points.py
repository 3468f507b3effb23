"""Files of named points: the same animal comes out of each format, whatever its axes, unit and names."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.generator import DogGait, generate, write_ai4animation
from kine2go_warp.motions.keypoints import KEYPOINTS
from kine2go_warp.motions.sources import SOURCES, source_of
from kine2go_warp.motions.sources.dialects import PointsDialect
from kine2go_warp.motions.sources.points import with_z_up
from tests.motions.sources.files import AI4ANIMATION_PARENTS, ai4animation_points, dog, write_bvh
from tests.motions.test_fuzz import FUZZ, damage, read_or_refuse

SAME = {name: name for name in KEYPOINTS}
DOG = PointsDialect("table", SAME, 0.825, 0.04, 0.04, 0.1, unit="millimetres", up="z", time="time")


def dog_in_millimetres(num_frames=121):
    """Columns of a table of the generated dog."""
    points = 1e3 * dog(num_frames)
    columns = {f"{name}_{axis}": points[:, i, j] for i, name in enumerate(KEYPOINTS) for j, axis in enumerate("xyz")}
    return {"time": np.arange(num_frames) / 60.0, **columns}


def write_csv(path, columns):
    lines = [
        ",".join(columns),
        *(",".join(f"{value:.9g}" for value in row) for row in zip(*columns.values(), strict=True)),
    ]
    path.write_text("\n".join(lines) + "\n")
    return path


def write_c3d(path, points):
    """Write points [mm], shape [num_frames, 10, 3], as markers."""
    ezc3d = pytest.importorskip("ezc3d")
    c3d = ezc3d.c3d()
    c3d["parameters"]["POINT"]["RATE"]["value"] = [60.0]
    c3d["parameters"]["POINT"]["LABELS"]["value"] = list(KEYPOINTS)
    c3d["data"]["points"] = np.concatenate([points.transpose(2, 1, 0), np.ones((1, 10, len(points)))])
    c3d.write(str(path))


def test_bvh_of_ai4animations_skeleton_is_its_text(tmp_path):
    points = generate(DogGait(), 121).points
    write_ai4animation(points, tmp_path / "dog.txt")
    write_bvh(tmp_path / "dog.bvh", ai4animation_points(points), AI4ANIMATION_PARENTS)
    text, bvh = (
        SOURCES["ai4animation"].load(tmp_path / "dog.txt"),
        SOURCES["ai4animation_bvh"].load(tmp_path / "dog.bvh"),
    )
    np.testing.assert_allclose(bvh.position, text.position, atol=2e-5)
    assert bvh.rate == pytest.approx(60.0)


def test_tables_parquet_arrays_and_markers_hold_one_dog(tmp_path):
    pyarrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    columns, points = dog_in_millimetres(), 1e3 * dog()
    write_csv(tmp_path / "dog.csv", columns)
    parquet.write_table(pyarrow.table(columns), tmp_path / "dog.parquet")
    np.savez(tmp_path / "dog.npz", time=columns["time"], **{name: points[:, i] for i, name in enumerate(KEYPOINTS)})
    write_c3d(tmp_path / "dog.c3d", points)
    for file, dialect in (
        ("dog.csv", DOG),
        ("dog.parquet", DOG),
        ("dog.npz", replace(DOG, format="arrays")),
        ("dog.c3d", replace(DOG, format="c3d", time="")),
    ):
        motion = source_of("mine", dialect).load(tmp_path / file)
        np.testing.assert_allclose(motion.position, dog(), atol=1e-5, err_msg=file)
        assert motion.rate == pytest.approx(60.0), file


def test_markers_that_were_not_seen_for_a_moment_are_filled(tmp_path):
    points = 1e3 * dog()
    points[40:45, 6] = np.nan
    write_c3d(tmp_path / "dog.c3d", points)
    motion = source_of("mine", replace(DOG, format="c3d", time="")).load(tmp_path / "dog.c3d")
    assert motion.remarks == ("FL_toe not finite in frames 40 to 44, filled",)
    assert np.abs(motion.position - dog()).max() < 0.02


@pytest.mark.parametrize("up", ["x", "y", "z", "-x", "-y", "-z"])
def test_axes_stay_right_handed_and_the_named_one_points_up(up):
    turned = with_z_up(np.eye(3), up, left_handed=False)
    assert np.linalg.det(turned) == pytest.approx(1.0)
    axis = np.eye(3)["xyz".index(up[-1])] * (-1.0 if up[0] == "-" else 1.0)
    np.testing.assert_allclose(with_z_up(axis, up, left_handed=False), [0.0, 0.0, 1.0])
    assert np.linalg.det(with_z_up(np.eye(3), up, left_handed=True)) == pytest.approx(-1.0)


def test_a_point_may_be_the_middle_of_two(tmp_path):
    points = dog()
    arrays = {name: points[:, i] for i, name in enumerate(KEYPOINTS) if name != "neck"}
    offset = np.array([0.0, 0.05, 0.0])
    np.savez(
        tmp_path / "dog.npz", time=np.arange(121) / 60.0, a=points[:, 1] + offset, b=points[:, 1] - offset, **arrays
    )
    dialect = replace(DOG, format="arrays", unit="metres", points={**SAME, "neck": "a + b"})
    np.testing.assert_allclose(source_of("mine", dialect).load(tmp_path / "dog.npz").position, points, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"FL_toe_z": None}, "has no column 'FL_toe_z'"),
        ({"time": None}, "has no column 'time' of time stamps"),
        ({"time": lambda time: time * 0.0}, "time stamps do not rise"),
        ({"time": lambda time: time**2}, "off an even grid"),
        ({"time": lambda time: time * 1000.0}, "are the stamps in seconds"),
        ({"neck_x": lambda x: np.where(np.arange(121) == 7, np.inf, x)}, r"dog\.csv, line 9: .*neck_x"),
    ],
)
def test_what_is_wrong_with_a_table_is_named(tmp_path, change, message):
    columns = dog_in_millimetres()
    for name, how in change.items():
        columns = {key: how(v) if key == name and how else v for key, v in columns.items() if key != name or how}
    with pytest.raises(ClipError, match=message):
        source_of("mine", DOG).load(write_csv(tmp_path / "dog.csv", columns))


@FUZZ
@given(data=st.data())
def test_damaged_tables_are_read_or_refused(tmp_path, data):
    path = tmp_path / "dog.csv"
    text = write_csv(path, dog_in_millimetres(12)).read_text()
    path.write_text(data.draw(damage(text)), encoding="utf-8", errors="surrogatepass")
    read_or_refuse(source_of("mine", DOG), path)


@FUZZ
@given(data=st.data(), name=st.sampled_from(["dog.parquet", "dog.npz"]))
def test_damaged_binary_files_are_read_or_refused(tmp_path, data, name):
    pyarrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    path, columns, points = tmp_path / name, dog_in_millimetres(12), 1e3 * dog(12)
    if name == "dog.parquet":
        parquet.write_table(pyarrow.table(columns), path)
    else:
        np.savez(path, time=columns["time"], **{one: points[:, i] for i, one in enumerate(KEYPOINTS)})
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(bytes(content[: data.draw(st.integers(0, len(content)))]))
    read_or_refuse(source_of("mine", DOG if name == "dog.parquet" else replace(DOG, format="arrays")), path)


@pytest.mark.parametrize(
    "damage",
    [
        lambda content: content[:520],  # ezc3d looks for the end of its parameters for ever
        lambda content: content[:749] + bytes([234]) + content[750:],  # and crashes
        lambda content: content[:-700],
        lambda content: b"\x02\x50" + bytes(510) + content[:0],
        lambda content: content[:0],
    ],
)
def test_damaged_markers_are_refused(tmp_path, monkeypatch, damage):
    monkeypatch.setattr("kine2go_warp.motions.sources.points.C3D_TIME", 10.0)
    write_c3d(tmp_path / "dog.c3d", 1e3 * dog(12))
    (tmp_path / "dog.c3d").write_bytes(damage((tmp_path / "dog.c3d").read_bytes()))
    with pytest.raises(ClipError, match=r"dog\.c3d: .*C3D file"):
        source_of("mine", replace(DOG, format="c3d", time="")).load(tmp_path / "dog.c3d")


@pytest.mark.parametrize(("frames", "theirs"), [((1085, 1124), "right_turn0"), ((2404, 2450), "left_turn0")])
def test_a_dog_turns_as_in_the_retargeting_of_another_project(frames, theirs, data_folder):
    """The project amp_go2 has the same ranges of ``dog_walk09``, which the paper calls left_turn and right_turn."""
    motion = SOURCES["ai4animation"].read(data_folder / "ai4animation" / "dog_walk09_joint_pos.txt")
    forward = (motion.point("neck") - motion.point("pelvis"))[slice(*frames)]
    rows = json.loads((data_folder / f"public/amp_txt/go2/{theirs}.txt").read_text())["Frames"]
    heading = Rotation.from_quat(np.array(rows)[:, 3:7]).apply([1.0, 0.0, 0.0])
    ours, other = (np.unwrap(np.arctan2(y, x)) for x, y, _ in (forward.T, heading.T))
    np.testing.assert_allclose(ours - ours[0], other - other[0], atol=0.15)
    assert np.sign(ours[-1] - ours[0]) == (1.0 if theirs.startswith("left") else -1.0)
