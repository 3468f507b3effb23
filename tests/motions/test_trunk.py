"""The robot's trunk follows the animal's: pitch, roll and height of every source, computed from its file anew."""

from dataclasses import replace

import numpy as np
import pytest

from kine2go_warp.motions.catalogue import load_catalogue
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.motions.hops import Hop, generate_hops, write_solo8
from kine2go_warp.motions.keypoints import FrameRange
from kine2go_warp.motions.retarget import retarget
from kine2go_warp.motions.sources import SOURCES, MotionSource, Solo8
from kine2go_warp.motions.sources.joints import JointSource
from kine2go_warp.motions.sources.points import PointSource
from kine2go_warp.robots import GO2
from kine2go_warp.rotations import to_rotation
from tests.motions.test_vhdc import horse, write

CASES = ("dog_trot", "made_up_horse", "hops")
REAL = [
    entry.name
    for entry in load_catalogue().values()
    if not entry.bundled and entry.source != "solo8" and entry.kind == "cycle"
]
LEVEL = {"ai4animation": ("hips", 1.2), "vhdc": ("spine", 1.0), "solo8": ("spine", 1.0)}
"""What shows the animal's trunk line, and how well the robot's trunk agrees with it [deg]. Of dogs it is the line from
the hind hips to the shoulders; their neck keypoint lies below it."""


@pytest.fixture(scope="module", params=(*CASES, *REAL))
def made(request, solver, tmp_path_factory):
    """A clip, and the keypoints of its frames in the robot's size."""
    folder, entries = tmp_path_factory.mktemp("sources"), load_catalogue()
    match request.param:
        case "made_up_horse":
            write(folder / "horse.csv", *horse())
            entry = replace(entries["vhdc_horse1_s1_walk_01"], file="horse.csv", frames=FrameRange(60, 120))
        case "hops":
            write_solo8(generate_hops(Hop(), 120)[None], folder / "hops.pt")
            entry = replace(entries["solo8_jump_forward_a"], file="hops.pt:0", frames=FrameRange(25, 50))
        case name:
            entry = entries[name]
            folder = None if entry.bundled else request.getfixturevalue("data_folder")
    source = entry.motion_source
    clip = retarget(entry, folder, solver, RetargetConfig()).clip
    return source, clip, source.load(entry.path(folder), entry.rate).scaled(source.scale)


def test_every_source_is_tested():
    entries = load_catalogue()
    classes = {name for name, source in SOURCES.items() if not isinstance(source, PointSource | JointSource)}
    assert {entries[name].source for name in REAL} | {"solo8"} == classes == set(LEVEL)


def test_pitch_and_roll_are_the_animals_in_the_mean(made):
    source, clip, whole = made
    motion = whole.frames(clip.origin.start, clip.origin.end)
    hips = motion.points("hip")
    line = {
        "spine": motion.point("neck") - motion.point("pelvis"),
        "hips": hips[:, :2].mean(axis=1) - hips[:, 2:].mean(axis=1),
    }
    kind, tolerance = LEVEL[source.name]
    across = hips[:, [0, 2]].mean(axis=1) - hips[:, [1, 3]].mean(axis=1)
    axes = to_rotation(clip.root_orientation).as_matrix()
    assert mean_rise(axes[:, :, 0]) == pytest.approx(mean_rise(line[kind]), abs=tolerance)
    assert mean_rise(axes[:, :, 1]) == pytest.approx(mean_rise(across), abs=tolerance)


def test_the_base_is_as_high_as_the_animals_trunk(made):
    source, clip, whole = made
    motion = whole.frames(clip.origin.start, clip.origin.end)
    floor = np.quantile(whole.points("toe")[..., 2], 0.05, axis=0).mean()
    middle = 0.5 * (motion.point("pelvis") + motion.point("neck"))[:, 2].mean() - floor
    assert clip.root_position[:, 2].mean() == pytest.approx(middle + GO2.foot_radius - source.root_drop, abs=0.015)


def mean_rise(lines):
    """Mean angle of lines above the horizon [deg]."""
    return np.degrees(np.arctan2(lines[:, 2], np.linalg.norm(lines[:, :2], axis=1))).mean()


def test_hops_come_back_joint_by_joint_with_no_splay(solver, tmp_path):
    """Solo8's legs times 1.33 are Go2's, so that the angles are its own: only rear knees bend the other way."""
    rows = generate_hops(Hop(), 120)
    write_solo8(rows[None], tmp_path / "hops.pt")
    entry = load_catalogue()["solo8_jump_forward_a"]
    entry = replace(entry, file="hops.pt:0", frames=FrameRange(25, 50))
    clip = retarget(entry, tmp_path, solver, RetargetConfig(mode="plain", search_time=0.0)).clip
    assert np.degrees(np.abs(clip.joint_position[:, ::3])).max() < 0.5
    ours = clip.joint_position.reshape(-1, 4, 3)[:, :2, 1:]
    theirs = rows[25:50, 17:21].reshape(-1, 2, 2)
    np.testing.assert_allclose(ours, theirs, atol=0.02)


def test_each_pair_of_a_horses_hooves_stands_below_its_hips(made):
    source, clip, whole = made
    if source.name != "vhdc":
        pytest.skip("dogs and Solo8 have hips of their own")
    toes = whole.points("toe")
    speed = np.linalg.norm(np.gradient(toes[..., :2], 1.0 / whole.rate, axis=0), axis=-1)
    stands = (toes[..., 2] <= np.quantile(toes[..., 2], 0.5, axis=0)) & (speed < 0.1)
    stands = stands[clip.origin.start : clip.origin.end]
    rotation = to_rotation(clip.root_orientation)
    yaw = np.arctan2(*rotation.as_matrix()[:, :2, 0].T[::-1])
    along = np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    for pair, offset in ((slice(0, 2), 1.0), (slice(2, 4), -1.0)):
        hip = clip.root_position + rotation.apply([offset * GO2.legs[0].hip_offset[0], 0.0, 0.0])
        ahead = np.einsum("tkj,tj->tk", clip.foot_position[:, pair, :2] - hip[:, None, :2], along)
        assert abs(ahead[stands[:, pair]].mean()) < 0.015


def test_a_source_that_leaves_out_an_offset_is_refused():
    with pytest.raises(TypeError, match="Yak does not state scale, root_drop, forward_lift, foot_outward"):

        class Yak(MotionSource):
            name = "yak"

    assert Solo8.root_drop == 0.0
