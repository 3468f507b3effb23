"""Faults of motion files, whichever reader they come from: repaired with a remark, or refused with frame and point.

The names of the cases (tilted-floor, lost-marker-zeros, one-frame-glitch, centimetres, byte-order-mark,
rate-of-a-text-file, bvh-and-joint-space) are those under which the faults were first seen.
"""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.catalogue import load_catalogue
from kine2go_warp.motions.floor import fit_floor
from kine2go_warp.motions.generator import PACE, TROT, WALK, DogGait, generate, write_ai4animation
from kine2go_warp.motions.hops import Hop, generate_hops, write_solo8
from kine2go_warp.motions.keypoints import KEYPOINTS
from kine2go_warp.motions.sources import AI4Animation, MotionSource, Solo8, Vhdc
from kine2go_warp.motions.sources.ai4animation import COLUMN_OF_KEYPOINT
from tests.motions.test_targets import keypoints
from tests.motions.test_vhdc import horse, write

COLUMNS = [COLUMN_OF_KEYPOINT[name] for name in KEYPOINTS]


class Given(MotionSource):
    """A reader of anything: what it is given."""

    name, scale, root_drop, forward_lift, foot_outward = "given", 0.825, 0.04, 0.04, 0.1

    def __init__(self, motion):
        self.motion = motion

    def read(self, path):
        del path
        return self.motion


def load(motion, folder):
    return Given(motion).load(folder / "any.file")


@pytest.fixture(params=[(25, TROT), (30, WALK), (60, TROT), (60, PACE), (120, TROT), (240, WALK)])
def good(request):
    rate, phases = request.param
    return keypoints(
        DogGait(phases=phases, rate=float(rate), stride_frames=rate // 2, duty=0.6, turn_rate=0.2), 3 * rate
    )


@pytest.mark.parametrize("scale", [0.5, 1.0, 2.0])
def test_a_good_motion_is_left_as_it_is(good, tmp_path, scale):
    motion = good[0].scaled(scale)
    loaded = load(motion, tmp_path)
    assert loaded.remarks == ()
    assert np.array_equal(loaded.position, motion.position)


@pytest.mark.parametrize("name", KEYPOINTS)
@pytest.mark.parametrize("width", [1, 2])
def test_one_frame_glitch_is_repaired_and_named(good, tmp_path, name, width):
    motion, index = good[0], KEYPOINTS.index(name)
    if width > 1 and motion.rate < 59.0:
        pytest.skip("two frames at 30 Hz are time enough for a step")
    bad, first = motion.position.copy(), motion.num_frames // 2
    bad[first : first + width, index] += [0.3, 0.2, 0.3]
    loaded = load(replace(motion, position=bad), tmp_path)
    assert [remark for remark in loaded.remarks if f"{name} jumps in frame" in remark and str(first) in remark]
    assert np.abs(loaded.position - motion.position).max() < 0.03 * (60.0 / motion.rate) * 2.0


@pytest.mark.parametrize("last", [0, 20])
def test_swapped_toes_are_put_right_for_one_frame_and_for_many(tmp_path, last):
    """Case one-frame-glitch, its other form."""
    motion, _ = keypoints(DogGait(), 180)
    toes = [KEYPOINTS.index("FL_toe"), KEYPOINTS.index("FR_toe")]
    bad = motion.position.copy()
    bad[45 : 46 + last, toes] = bad[45 : 46 + last, toes[::-1]]
    loaded = load(replace(motion, position=bad), tmp_path)
    assert np.abs(loaded.position - motion.position).max() < 0.02
    assert len(loaded.remarks) > 0


@pytest.mark.parametrize("lost", [0.0, np.nan])
@pytest.mark.parametrize("name", ["pelvis", "RL_hip", "FR_toe"])
def test_lost_points_are_filled_if_the_gap_is_short(tmp_path, lost, name):
    """Case lost-marker-zeros, for any point of any reader."""
    motion, _ = keypoints(DogGait(), 180)
    bad = motion.position.copy()
    bad[70:76, KEYPOINTS.index(name)] = lost
    loaded = load(replace(motion, position=bad), tmp_path)
    assert np.abs(loaded.position - motion.position).max() < 0.04
    assert f"{name} {'all zeros' if lost == 0.0 else 'not finite'} in frames 70 to 75, filled" in loaded.remarks
    bad[70:100, KEYPOINTS.index(name)] = lost
    with pytest.raises(ClipError, match=rf"any\.file, frames 70 to 99: {name} was lost there, a gap longer than"):
        load(replace(motion, position=bad), tmp_path)


def test_held_points_and_repeated_frames_are_filled(tmp_path):
    motion, _ = keypoints(DogGait(), 180)
    bad = motion.position.copy()
    bad[51:54, KEYPOINTS.index("neck")] = bad[50, KEYPOINTS.index("neck")]
    bad[100:102] = bad[99]
    loaded = load(replace(motion, position=bad), tmp_path)
    assert any("neck held in frames 51 to 53" in remark for remark in loaded.remarks)
    assert np.abs(loaded.position - motion.position).max() < 0.03


@pytest.mark.parametrize(
    ("factor", "unit"), [(100.0, "centimetres"), (1000.0, "millimetres"), (39.37, "inches"), (3.28084, "feet")]
)
def test_centimetres_and_other_units_are_named(tmp_path, factor, unit):
    write_ai4animation(factor * generate(DogGait(), 60).points, tmp_path / "dog.txt")
    message = "exceeds 1000|likely in millimetres" if factor == 1000.0 else f"not in metres; it is likely in {unit}"
    with pytest.raises(ClipError, match=message):
        AI4Animation().load(tmp_path / "dog.txt")


def test_a_horse_in_metres_is_not_taken_for_a_lost_marker(tmp_path):
    time, markers = horse()
    with pytest.raises(ClipError, match="not in millimetres; it is likely in metres"):
        Vhdc().load(write(tmp_path / "horse.csv", time, 1e-3 * markers))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p: p * [1.0, -1.0, 1.0], "mirrored"),
        (lambda p: p * [1.0, 1.0, -1.0], "above the trunk"),
        (lambda p: p[:, [0, 1, 4, 5, 2, 3, 8, 9, 6, 7]], "front and hind legs are swapped"),
    ],
    ids=["mirrored", "upside down", "front and hind"],
)
def test_wrong_handedness_is_refused(tmp_path, change, message):
    motion, _ = keypoints(DogGait(), 120)
    with pytest.raises(ClipError, match=message):
        load(replace(motion, position=change(motion.position)), tmp_path)


def test_one_pair_of_feet_under_each_others_name_is_put_right(tmp_path):
    motion, _ = keypoints(DogGait(), 120)
    loaded = load(replace(motion, position=motion.position[:, [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]]), tmp_path)
    assert np.array_equal(loaded.position, motion.position)
    assert loaded.remarks == ("FL_toe and FR_toe under each other's name in the whole file, put right",)


@pytest.mark.parametrize("degrees", [0.5, 1.0, 2.0, 5.0])
@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_a_tilted_floor_is_levelled_and_said(tmp_path, degrees, yaw):
    """Case tilted-floor: the trot comes out as on level ground."""
    motion, truth = keypoints(DogGait(), 480)
    turn = Rotation.from_euler("ZYX", [yaw, np.radians(degrees), 0.0])
    tilted = turn.apply(motion.position.reshape(-1, 3)).reshape(motion.position.shape)
    loaded = load(replace(motion, position=tilted), tmp_path)
    assert len(loaded.remarks) == 1
    assert f"the floor rose by {degrees:.1f} degrees" in loaded.remarks[0]
    heights = loaded.points("toe")[..., 2]
    assert np.ptp(heights[truth.contact]) < 2e-3


def test_sitting_does_not_pull_the_floor():
    """Two thirds of the file the animal lies, its toes 5 cm above the floor."""
    motion, _ = keypoints(DogGait(), 180)
    lying = np.repeat(motion.position[-1:], 360, axis=0)
    lying[:, :6, 2] -= 0.28
    lying[:, 6:, 2] += np.where(np.arange(360)[:, None] % 2 == 0, 0.0, 1e-4) - 0.012
    position = np.concatenate([motion.position, lying])
    _, height = fit_floor(replace(motion, time=np.arange(540) / 60.0, position=position), is_level=True)
    np.testing.assert_allclose(height, DogGait().toe_height, atol=2e-3)


def spoilt(text, how):
    return {
        "bom": ("\ufeff" + text).encode("utf-8"),
        "utf-16": text.encode("utf-16"),
        "crlf": text.replace("\n", "\r\n").encode(),
        "semicolons": text.replace(",", ";").replace(".", ",").encode(),
        "semicolons with points": text.replace(",", ";").encode(),
    }[how]


@pytest.mark.parametrize("how", ["bom", "utf-16", "crlf", "semicolons", "semicolons with points"])
@pytest.mark.parametrize("source", [AI4Animation, Vhdc])
def test_a_byte_order_mark_and_other_ways_to_save_a_table_change_nothing(tmp_path, how, source):
    path = tmp_path / "motion.txt"
    if source is Vhdc:
        write(path, *horse(num_frames=60))
    else:
        write_ai4animation(generate(DogGait(), 60).points, path)
    plain = source().load(path)
    path.write_bytes(spoilt(path.read_text(), how))
    np.testing.assert_allclose(source().load(path).position, plain.position)


def test_the_rate_of_a_text_file_is_the_one_that_is_stated(tmp_path):
    write_ai4animation(generate(DogGait(rate=30.0), 60).points, tmp_path / "dog.txt")
    assert AI4Animation().load(tmp_path / "dog.txt", 30.0).rate == pytest.approx(30.0)
    assert AI4Animation().load(tmp_path / "dog.txt").rate == pytest.approx(60.0)
    assert Vhdc().load(write(tmp_path / "horse.csv", *horse()), 30.0).rate == pytest.approx(60.0, rel=1e-3)


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("HIERARCHY\nROOT Hips\n{\n OFFSET 0 0 0\n}\nMOTION\n", "a BVH file"),
        ('{\n "LoopMode": "Wrap",\n "Frames": [[0, 0]]\n}\n', "a joint-space motion file"),
    ],
)
@pytest.mark.parametrize("source", [AI4Animation, Vhdc])
def test_bvh_and_joint_space_files_are_known_by_their_first_lines(tmp_path, text, kind, source):
    (tmp_path / "motion.txt").write_text(text)
    with pytest.raises(ClipError, match=rf"{kind}.*docs/adding-a-source\.md"):
        source().load(tmp_path / "motion.txt")


def test_a_hoof_written_as_zeros_is_filled_before_the_belt_moves_it(tmp_path):
    """Case lost-marker-zeros."""
    time, markers = horse()
    plain = Vhdc().load(write(tmp_path / "horse.csv", time, markers))
    markers[100:106, 3] = 0.0
    motion = Vhdc().load(write(tmp_path / "horse.csv", time, markers))
    assert motion.remarks == ("HFL all zeros in frames 100 to 105, filled",)
    assert np.abs(motion.position - plain.position).max() < 0.15


def test_a_jump_of_solo8s_joint_is_repaired(tmp_path):
    rows = generate_hops(Hop(), 120)
    write_solo8(rows[None], tmp_path / "hops.pt")
    plain = Solo8().load(tmp_path / "hops.pt:0")
    assert plain.remarks == ()
    rows[60, 17] += 1.0
    torch.save(torch.tensor(rows[None], dtype=torch.float32), tmp_path / "hops.pt")
    motion = Solo8().load(tmp_path / "hops.pt:0")
    assert motion.remarks == ("FL_toe jumps in frame 60, filled",)
    assert np.abs(motion.position - plain.position).max() < 0.02


REAL = sorted({entry.file: entry for entry in load_catalogue().values() if entry.source != "solo8"}.items())
SWAPPED_HOOVES = "vhdc/Horse1_M2_trot2_kinematics.csv"


@pytest.mark.parametrize(("file", "entry"), REAL, ids=[file for file, _ in REAL])
def test_real_files_are_read_without_false_alarms(data_folder, file, entry):
    motion = entry.motion_source.load(entry.path(data_folder), entry.rate)
    expected = 1 if file == SWAPPED_HOOVES else 0
    assert len(motion.remarks) == expected, motion.remarks
