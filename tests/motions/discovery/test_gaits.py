"""Labels and figures of gaits whose footfalls are known, and of real ranges that were looked at."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kine2go_warp.motions.discovery.cuts import cut, cycles
from kine2go_warp.motions.discovery.recording import read_recording
from kine2go_warp.motions.generator import HIP_OF_LEG, PACE, TROT, WALK, DogGait, generate, write_ai4animation
from kine2go_warp.motions.own_file import OwnFile
from kine2go_warp.motions.sources import AI4Animation
from kine2go_warp.motions.sources.ai4animation import COLUMN_OF_KEYPOINT
from kine2go_warp.robots import GO2

GAITS = {
    "walk": DogGait(WALK, stride_frames=48, speed=0.6, duty=0.64),
    "trot": DogGait(TROT, stride_frames=30, speed=1.2, duty=0.45),
    "slow trot": DogGait(TROT, stride_frames=40, speed=0.7, duty=0.56),
    "pace": DogGait(PACE, stride_frames=36, speed=1.0, duty=0.5),
    "canter": DogGait((0.3, 0.6, 0.0, 0.3), stride_frames=30, speed=1.6, duty=0.38),
    "gallop": DogGait((0.5, 0.65, 0.0, 0.15), stride_frames=28, speed=2.4, duty=0.3),
    "rotary gallop": DogGait((0.15, 0.33, 0.0, 0.83), stride_frames=28, speed=2.4, duty=0.3),
    "bound": DogGait((0.5, 0.5, 0.0, 0.0), stride_frames=28, speed=1.8, duty=0.35),
    "jump": DogGait((0.0, 0.0, 0.0, 0.0), stride_frames=30, speed=0.8, duty=0.5),
    "turn": DogGait(TROT, stride_frames=36, speed=0.4, duty=0.55, turn_rate=1.2),
}


def recorded(gait, folder, num_frames=240, shift=None):
    points = generate(gait, num_frames).points
    if shift is not None:
        points = points + shift
    write_ai4animation(points, folder / "dog.txt")
    return read_recording(OwnFile(folder / "dog.txt", "own"), GO2)


def sideways():
    """What moves each leg's points so that the animal looks to the left of its way [m], shape [27, 3]."""
    shift = np.zeros((27, 3))
    turned = np.stack([-HIP_OF_LEG[:, 1], HIP_OF_LEG[:, 0]], axis=-1) - HIP_OF_LEG
    for leg, name in enumerate(("FL", "FR", "RL", "RR")):
        shift[COLUMN_OF_KEYPOINT[f"{name}_hip"] : COLUMN_OF_KEYPOINT[f"{name}_toe"] + 1, :2] = turned[leg]
    for point, x in (("pelvis", -0.2), ("neck", 0.2)):
        shift[COLUMN_OF_KEYPOINT[point], :2] = [-x, x]
    return shift


@pytest.mark.parametrize("name", GAITS)
def test_a_generated_gait_gets_its_label_and_its_figures(tmp_path, name):
    gait = replace(GAITS[name], brisk=True)
    recording = recorded(gait, tmp_path)
    found = cut(recording, "cycle", 60, 60 + gait.stride_frames)
    assert found.label == name.removeprefix("slow ").removeprefix("rotary ")
    assert found.gait.strides == 1
    assert found.gait.speed == pytest.approx(AI4Animation.scale * gait.speed, rel=0.03)
    assert found.gait.turn_rate == pytest.approx(gait.turn_rate, abs=0.02)
    # A generated foot comes to rest within the last frames before it stands, and gathers speed after it.
    longer = (np.array(found.gait.duty) - gait.duty) * gait.stride_frames
    assert 0.0 <= longer.min() <= longer.max() <= 4.0
    apart = np.array(found.gait.phase) - (np.array(gait.phases) - gait.phases[2])
    np.testing.assert_allclose((apart + 0.5) % 1.0 - 0.5, 0.0, atol=0.06)
    assert {(one.end - one.start, one.label) for one in cycles(recording)} == {(gait.stride_frames, found.label)}


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_dog_that_looks_across_its_way_strafes(tmp_path, side):
    shift = sideways() * (1.0 if side == "right" else [0.0, 0.0, 0.0])
    gait = DogGait(TROT, stride_frames=36, speed=0.4)
    if side == "left":
        # The mirror image of the way: the animal looks to the right of it.
        shift = np.where(np.arange(3) == 1, -1.0, 1.0) * sideways()[mirrored_points()]
    found = cut(recorded(gait, tmp_path, shift=shift), "cycle", 60, 96)
    assert (found.label, found.gait.side) == ("strafe", side)
    assert abs(found.gait.sideways) == pytest.approx(AI4Animation.scale * 0.4, rel=0.03)
    assert abs(found.gait.speed) < 0.02


def mirrored_points():
    """The points of the other side, in the order of AI4Animation."""
    order = np.arange(27)
    for one, other in (("FL", "FR"), ("RL", "RR")):
        here, there = (
            slice(COLUMN_OF_KEYPOINT[f"{leg}_hip"], COLUMN_OF_KEYPOINT[f"{leg}_toe"] + 1) for leg in (one, other)
        )
        order[here], order[there] = np.arange(27)[there].copy(), np.arange(27)[here].copy()
    return order


DOG = "ai4animation/dog_{}_joint_pos.txt"
LOOKED_AT = [
    # file, kind, first frame, end, label, and what is seen in drawings of the skeleton and in the heights of the toes
    (DOG.format("walk00"), "cycle", 162, 201, "pace", "FL with RL, FR with RR; the paper's pace"),
    (DOG.format("walk03"), "cycle", 448, 481, "trot", "FL with RR, FR with RL; the paper's trot_00"),
    (DOG.format("run04"), "cycle", 630, 663, "trot", "the same; the paper's trot_01"),
    (DOG.format("run00"), "cycle", 430, 459, "gallop", "RR, RL, FL, FR, then a flight; the paper's canter"),
    (DOG.format("run02"), "cycle", 0, 27, "canter", "three beats: RL, RR with FL, FR"),
    (DOG.format("walk09"), "cycle", 847, 896, "walk", "four beats: RR, FR, RL, FL"),
    (DOG.format("walk09"), "cycle", 1085, 1124, "turn", "to its right; the paper's left_turn"),
    (DOG.format("walk09"), "cycle", 2404, 2450, "turn", "to its left on the spot; the paper's right_turn"),
    (DOG.format("walk04"), "still", 33, 153, "sit", "hind legs folded below, forelegs straight"),
    (DOG.format("walk06"), "still", 846, 966, "lie", "forelegs stretched out on the floor"),
    ("public/apex_csv/sidesteps_go1_STMR_resampled_50Hz.csv", "cycle", 181, 249, "strafe", "named so by its authors"),
    ("public/labrador_bvh/dog_jump_002.bvh", "once", 466, 625, "jump", "named so by its authors"),
]
"""Twelve ranges. Thresholds were chosen on the dogs' files, and looked at again after the jump; the sidestep and what
NAMED lists were only read."""

NAMED = {
    "vhdc/Horse1_M1_walk1_kinematics.csv": "walk",
    "vhdc/Horse1_M2_trot2_kinematics.csv": "trot",
    "public/mimickit_go2/go2_pace.pkl": "pace",
    "public/mimickit_go2/go2_trot.pkl": "trot",
    "public/amp_txt/go2/pace1.txt": "pace",
    "public/amp_txt/go2/trot2.txt": "trot",
}
"""What the authors of files call them."""


def real(data_folder, name):
    path = data_folder / name
    if not path.is_file():
        pytest.skip(f"no real clip {path}")
    return read_recording(OwnFile(Path(path), "test"), GO2)


@pytest.mark.parametrize("row", LOOKED_AT, ids=lambda row: f"{row[4]}-{row[2]}")
def test_a_real_range_gets_the_label_that_it_has_to_the_eye(data_folder, row):
    name, kind, start, end, label, _ = row
    found = cut(real(data_folder, name), kind, start, end)
    assert found.label == label, found.gait


@pytest.mark.parametrize("name", NAMED)
def test_most_cycles_of_a_named_file_get_its_name(data_folder, name):
    found = cycles(real(data_folder, name))
    labels = [one.label for one in found]
    assert labels.count(NAMED[name]) >= max(0.8 * len(labels), 1), labels


def test_turns_to_both_sides_are_told_apart(data_folder):
    recording = real(data_folder, DOG.format("walk09"))
    sides = [cut(recording, "cycle", *frames).gait.side for frames in ((1085, 1124), (2404, 2450))]
    assert sides == ["right", "left"]
