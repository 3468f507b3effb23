"""Sequences: what leads from part to part keeps within the limits of any clip."""

import numpy as np
import pytest

from kine2go_warp.errors import CatalogueError
from kine2go_warp.motions.catalogue import load_catalogue
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.motions.cycle import rest_places
from kine2go_warp.motions.generator import CROUCH, WALK, DogGait, generate, write_ai4animation
from kine2go_warp.motions.quality import assess, clip_faults
from kine2go_warp.motions.retarget import retarget
from kine2go_warp.robots import GO2
from kine2go_warp.rotations import heading

OWN = """
[[motion]]
name = "crouch"
file = "crouch.txt"
source = "ai4animation"
licence = "CC0"
citation = "us"
end = 121
kind = "once"
hold = 0.2

[[motion]]
name = "walk"
file = "walk.txt"
source = "ai4animation"
licence = "CC BY 4.0"
citation = "us"
start = 60
end = 108

[[motion]]
name = "outing"
"""
TURNING = DogGait(phases=WALK, duty=0.65, stride_frames=48, speed=0.5, turn_rate=0.4)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sequence")
    write_ai4animation(generate(CROUCH, 240).points, folder / "crouch.txt")
    write_ai4animation(generate(TURNING, 180).points, folder / "walk.txt")
    return folder


def entry_of(folder, parts):
    table = folder / "mine.toml"
    table.write_text(OWN.replace("citation", "rate = 60.0\ncitation") + f"parts = {parts}\n")
    return load_catalogue(table)["outing"]


@pytest.fixture(scope="module")
def result(folder, solver):
    parts = '[{ motion = "walk", cycles = 2 }, "crouch", { motion = "dog_trot", seconds = 1.2 }, "walk"]'
    return retarget(entry_of(folder, parts), None, solver, RetargetConfig(search_time=0.0))


def test_a_sequence_is_played_once_and_keeps_within_the_limits_of_any_clip(result):
    clip, quality = result.clip, assess(result, GO2)
    assert clip.kind == "once"
    assert clip_faults(quality) == []
    assert clip.slow_down == 1.0
    assert quality.speed_share < 0.7
    assert quality.penetration < 5e-4
    assert quality.fidelity.contact_slip < 0.01
    jumps = np.abs(np.diff(clip.joint_velocity, axis=0)).max()
    # The trot alone has jumps of 8 rad/s from frame to frame, where its feet touch down.
    assert jumps < 10.0
    assert np.linalg.norm(np.diff(clip.root_linear_velocity, axis=0), axis=1).max() < 0.1
    assert np.abs(np.diff(clip.root_angular_velocity, axis=0)).max() < 0.2


def test_a_sequence_goes_on_in_place_and_heading_and_passes_all_its_parts(result):
    clip = result.clip
    yaw = np.unwrap(heading(clip.root_orientation))
    # Two and three turning strides of 48 frames (the second walk lasts 2 s at least), and half of a second at each end.
    strides = (2 + 3) * 48 / 60
    assert strides * 0.4 < yaw[-1] < (strides + 2 * 0.5 + 2 * 2.0) * 0.4
    heights = clip.root_position[:, 2]
    depth = 0.825 * CROUCH.dip
    assert heights.max() - heights.min() == pytest.approx(depth, abs=0.015)
    speed = np.linalg.norm(clip.root_linear_velocity[:, :2], axis=1)
    assert speed.max() == pytest.approx(0.825 * 0.75, rel=0.05), "the trot is as fast as it is alone"
    lowest = int(np.argmin(heights))
    assert speed[lowest] < 1e-3, "the crouch is not moved by its neighbours"
    assert (clip.origin.source, clip.origin.file) == ("sequence", "walk + crouch + dog_trot + walk")
    assert clip.origin.licence == "CC BY 4.0; CC0; BSD-3-Clause"


def test_feet_that_stand_elsewhere_after_a_transition_step_there_in_diagonal_pairs(folder, solver):
    table = OWN.replace('file = "walk.txt"', 'file = "wide.txt"').replace("start = 60\nend = 108", "end = 60")
    gait = DogGait(phases=CROUCH.phases, stride_frames=CROUCH.stride_frames, speed=0.0)
    points = generate(gait, 60).points
    points[:, [15, 23], 1] -= 0.06
    write_ai4animation(points, folder / "wide.txt")
    table = table.replace('licence = "CC BY 4.0"', 'licence = "CC BY 4.0"\nkind = "once"')
    (folder / "wide.toml").write_text(table.replace("citation", "rate = 60.0\ncitation") + 'parts = ["crouch", "walk"]')
    result = retarget(load_catalogue(folder / "wide.toml")["outing"], None, solver, RetargetConfig())
    assert clip_faults(assess(result, GO2)) == []
    swings = result.clip.stance < 0.5
    assert not swings[:, [0, 2]].any(), "the left feet stay"
    right = [np.flatnonzero(swings[:, foot]) for foot in (1, 3)]
    assert all(len(one) for one in right)
    assert right[1][-1] < right[0][0], "RR steps with FL, before FR with RL"
    moved = result.clip.foot_position[-1, [1, 3], :2] - result.clip.foot_position[0, [1, 3], :2]
    assert np.linalg.norm(moved, axis=1) == pytest.approx(0.825 * 0.06, abs=0.01)


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ('["walk", "gone"]', "'outing' has the unknown part 'gone'"),
        ('["walk", "outing"]', "'outing' is a part of itself"),
        ('["walk"]', r"parts names 1 motion; a sequence has at least two"),
        ('["walk", 3]', r"line \d+, \[\[motion\]\]: parts has 3; each is a name"),
        ('["walk", { motion = "walk", cycles = 2, seconds = 1.0 }]', "parts has .*each is a name"),
        ('["walk", { motion = "walk", often = 2 }]', "parts has .*each is a name"),
        ('["walk", { motion = "crouch", cycles = 2 }]', "repeats 'crouch', which is played once"),
        ('"walk"', "parts is 'walk', not a list"),
        ('["walk", "walk"]\nfile = "x"', "has unknown file"),
    ],
)
def test_wrong_parts_end_with_one_line(folder, parts, message):
    with pytest.raises(CatalogueError, match=message) as caught:
        entry_of(folder, parts)
    assert "\n" not in str(caught.value)


def test_sequences_in_circles_are_refused(folder):
    other = '\n[[motion]]\nname = "inner"\nparts = ["walk", "outing"]\n'
    with pytest.raises(CatalogueError, match="is a part of itself"):
        entry_of(folder, '["walk", "inner"]' + other)


@pytest.mark.parametrize("ramps", [(0, 0), (20, 0), (0, 12), (20, 30)])
def test_places_come_from_rest_and_to_rest_or_go_on(ramps):
    places = rest_places(60, ramps, 5, 7)
    steps = np.diff(places)
    assert steps[30 + ramps[0] // 2] == pytest.approx(1.0)
    assert places[5] == pytest.approx(0.0)
    assert places[-8] == pytest.approx(60.0)
    assert steps[0] == pytest.approx(0.0 if ramps[0] else 1.0)
    assert steps[-1] == pytest.approx(0.0 if ramps[1] else 1.0)
    smallest = min((one for one in ramps if one), default=np.inf)
    assert np.abs(np.diff(steps)).max() <= 1.5 / smallest + 1e-9
