"""Files are recognised by what is in them, whatever their names are."""

from pathlib import Path

import numpy as np
import pytest

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.generator import DogGait, generate, write_ai4animation
from kine2go_warp.motions.keypoints import KEYPOINTS
from kine2go_warp.motions.sources import SOURCES
from kine2go_warp.motions.sources.recognition import guessed_points, recognise
from tests.motions.sources.files import (
    AI4ANIMATION,
    AI4ANIMATION_PARENTS,
    ai4animation_points,
    robot,
    write_amp,
    write_bvh,
    write_frames,
    write_pickle,
)
from tests.motions.test_vhdc import horse, write

REAL = {
    "labrador_bvh/*.bvh": "labrador",
    "labrador_retargeted/*.txt": "max",
    "amp_txt/*/*.txt": "amp",
    "mimickit_go2/*.pkl": "mimickit",
    "motion_imitation_txt/*.txt": "laikago",
    "apex_csv/*STMR*.csv": "apex",
}


def generated(folder: Path) -> dict[str, Path]:
    """A file of every format that can be generated, by the source that it is for."""
    points = generate(DogGait(), 121).points
    position, orientation, joints, _ = robot()
    rows = np.concatenate([position, orientation, joints.reshape(-1, 12)], axis=1)
    files = {name: folder / f"{name}.dat" for name in ("ai4animation", "ai4animation_bvh", "joints", "max", "clip")}
    write_ai4animation(points, files["ai4animation"])
    write_bvh(files["ai4animation_bvh"], ai4animation_points(points), AI4ANIMATION_PARENTS)
    write_frames(files["joints"], rows)
    opposite = (joints * [1.0, -1.0, -1.0]).reshape(-1, 12)
    base = [position, orientation]
    write_frames(files["max"], np.concatenate([*base, opposite], axis=1), LegOrder=["FL", "FR", "HL", "HR"])
    with files["clip"].open("wb") as file:
        arrays = {"root_position": position, "root_orientation": np.roll(orientation, 1, axis=1)}
        np.savez(file, **arrays, joint_position=joints.reshape(-1, 12), time=np.arange(len(position)) / 50.0)
    files["amp"] = write_amp(folder / "amp.dat")
    files["mimickit"] = write_pickle(folder / "mimickit.dat")
    files["vhdc"] = folder / "vhdc.dat"
    write(files["vhdc"], *horse())
    return files


def test_every_generated_file_is_taken_for_what_it_is(tmp_path):
    for name, path in generated(tmp_path).items():
        source, motion = recognise(path, SOURCES)
        assert source.name == name, path
        assert motion.num_frames >= 60, path


@pytest.mark.parametrize(("pattern", "expected"), REAL.items())
def test_real_files_are_taken_for_what_they_are(data_folder, pattern, expected):
    files = sorted((data_folder / "public").glob(pattern))
    if not files:
        pytest.skip(f"no {pattern} in {data_folder}/public")
    for file in files:
        source, motion = recognise(file, SOURCES)
        assert source.name == expected, file
        assert np.isfinite(motion.position).all(), file


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("go2_retarget_trot.csv", "go2 comes within 43 mm"),
        ("amble_pronk_pace_trot_canter.csv", "line 1202: 40 columns instead of 52"),
    ],
)
def test_files_at_odds_with_themselves_are_refused(data_folder, name, message):
    file = data_folder / "public" / "apex_csv" / name
    if not file.is_file():
        pytest.skip(f"no {file}")
    with pytest.raises(ClipError, match=message):
        recognise(file, SOURCES)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "0 line"),
        (b"one\ntwo\nthree\nfour\n", "which no source reads"),
        (b"{]", "not JSON"),
        (b'{"Frames": [], "FrameDuration": 0.02}', "no list of at least 3 frames"),
        (b"\x80\x04cos\nsystem\n.", "asks for os.system"),
        (b"PK\x03\x04damaged", "not an .npz of numbers"),
        (b"PAR1damaged", "not a Parquet file"),
        (b"HIERARCHY\nROOT a\n{\n", "not a BVH file"),
        (b"\xff\xff\xff", "not a text file"),
    ],
)
def test_what_cannot_be_recognised_says_what_it_is(tmp_path, content, message):
    path = tmp_path / "walk.dat"
    path.write_bytes(content)
    with pytest.raises(ClipError, match=message):
        recognise(path, SOURCES)


def test_points_are_guessed_by_their_names():
    expected = ["Hips", "Neck", "LeftShoulder", "RightShoulder", "LeftUpLeg", "RightUpLeg"]
    assert list(guessed_points(AI4ANIMATION).values())[:6] == expected
    other = [
        "mixamorig:Pelvis",
        "withers",
        "shoulder_l",
        "shoulder_r",
        "thigh.L",
        "thigh.R",
        "FrontPaw_l",
        "FrontPaw_r",
    ]
    guessed = guessed_points([*other, "HindPaw.L", "HindPaw.R", "jaw", "tail"])
    assert dict(zip(KEYPOINTS, [*other, "HindPaw.L", "HindPaw.R"], strict=True)) == guessed
    short = ["Root", "Chest", "ArmL", "ArmR", "LegL", "LegR", "PawL", "PawR", "HindPawL", "HindPawR"]
    assert list(guessed_points(sorted(short)).values()) == short
    assert guessed_points(["a", "b"])["neck"] == ""
    assert guessed_points(["tail", *KEYPOINTS]) == {name: name for name in KEYPOINTS}
