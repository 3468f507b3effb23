"""Bodies on the floor: generated animals that sit and lie, measured by MuJoCo's collisions of the robot's shapes."""

from dataclasses import replace

import numpy as np
import pytest

from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.mujoco_engine import world_tree
from kine2go_warp.errors import ClipError
from kine2go_warp.motions.body_contact import resting_ends
from kine2go_warp.motions.catalogue import load_catalogue, motion_named
from kine2go_warp.motions.clip import CONTACT_TOLERANCE, MotionClip
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.motions.generator import DogGait, generate, write_ai4animation
from kine2go_warp.motions.retarget import retarget
from kine2go_warp.motions.sources.ai4animation import COLUMN_OF_KEYPOINT, AI4Animation
from kine2go_warp.motions.variation import mirror_image
from kine2go_warp.robots import GO2
from kine2go_warp.robots.compiled import mujoco
from tests.motions.test_retarget import entry_of

STAND = replace(DogGait(), phases=(0.0, 0.0, 0.0, 0.0), stride_frames=100_000, speed=0.0, body_bob=0.0)
"""A dog whose feet are never lifted."""
LEGS = ("FL", "FR", "RL", "RR")
DOWN, UP = slice(60, 100), slice(200, 240)
"""Frames in which it goes down, and in which it rises again."""


def gone_down(ends):
    """A dog that stands, lets the named ends of its trunk down to the floor, stays and rises: 27 points."""
    points = generate(STAND, 300).points
    share = np.zeros(300)
    smooth = 0.5 - 0.5 * np.cos(np.pi * (np.arange(40) + 1.0) / 41.0)
    share[DOWN], share[UP], share[DOWN.stop : UP.start] = smooth, smooth[::-1], 1.0
    names = {"front": ("neck", "FL_hip", "FR_hip"), "rear": ("pelvis", "RL_hip", "RR_hip")}
    for end in ends:
        hips = points[0, COLUMN_OF_KEYPOINT[names[end][1]], 2]
        for name in names[end]:
            points[:, COLUMN_OF_KEYPOINT[name], 2] -= share * (hips - 0.06)
    return points


def distances(clip: MotionClip):
    """Return MuJoCo's distance of each of the robot's shapes from the floor [m] by its name, shape [num_frames]."""
    tree = world_tree(GO2, EnvConfig())
    for geom in tree.geoms:
        geom.margin = 1.0 if geom.name != "ground" else 0.0
    model = tree.compile()
    data = mujoco.MjData(model)
    joints = [model.joint(name).qposadr[0] for name in GO2.joint_names]
    found = np.full((clip.num_frames, model.ngeom), np.inf)
    for frame in range(clip.num_frames):
        data.qpos[:3], data.qpos[3:7] = clip.root_position[frame], clip.root_orientation[frame]
        data.qpos[joints] = clip.joint_position[frame]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        for contact in data.contact[: data.ncon]:
            for geom in contact.geom:
                found[frame, geom] = min(found[frame, geom], contact.dist)
    return {model.geom(geom).name: found[:, geom] for geom in range(model.ngeom) if model.geom(geom).name != "ground"}


def clip_of(points, folder, solver, **changes):
    write_ai4animation(points, folder / "dog.txt")
    entry = replace(entry_of("dog.txt", 0, 300), kind="once", **changes)
    return retarget(entry, folder, solver, RetargetConfig()).clip


@pytest.fixture(scope="module", params=[("rear",), ("front",), ("front", "rear")], ids=["sits", "bows", "lies"])
def low(request, solver, tmp_path_factory):
    """A clip of a dog that goes down at some ends, those ends, and the distances of its shapes from the floor."""
    clip = clip_of(gone_down(request.param), tmp_path_factory.mktemp("low"), solver)
    return clip, request.param, distances(clip)


@pytest.mark.parametrize("ends", [("rear",), ("front",), ("front", "rear")])
def test_ends_rest_from_when_they_are_down_until_they_rise(ends, tmp_path):
    write_ai4animation(gone_down(ends), tmp_path / "dog.txt")
    rests = resting_ends(AI4Animation().load(tmp_path / "dog.txt", 60.0), 0.0)
    for column, end in enumerate(("front", "rear")):
        frames = np.flatnonzero(rests[:, column])
        assert (len(frames) > 0) == (end in ends)
        if len(frames):
            assert DOWN.stop - 15 <= frames[0] <= DOWN.stop
            assert UP.start - 1 <= frames[-1] <= UP.start + 15


@pytest.mark.parametrize("height", [0.43, 0.2])
def test_animals_that_stand_or_creep_rest_on_nothing(height, tmp_path):
    write_ai4animation(generate(DogGait(body_height=height), 181).points, tmp_path / "dog.txt")
    assert not resting_ends(AI4Animation().load(tmp_path / "dog.txt", 60.0), 0.0).any()


def test_nothing_is_in_the_floor_and_standing_feet_are_on_it(low):
    clip, _, apart = low
    assert min(distance.min() for distance in apart.values()) > -1e-3
    feet = np.stack([apart[f"{leg}_foot_sphere"] for leg in LEGS], axis=1)
    assert np.abs(feet[clip.stance > 0.5]).max() < 1e-3
    assert clip.fidelity.contact_slip < 0.01


def test_knees_of_an_end_that_rests_lie_on_the_floor(low):
    clip, ends, apart = low
    for column, (end, legs) in enumerate((("front", LEGS[:2]), ("rear", LEGS[2:]))):
        rests = clip.body_rests[:, column] > 0.5
        assert rests.any() == (end in ends)
        if end in ends:
            knees = np.stack([apart[f"{leg}_thigh_capsule"] for leg in legs], axis=1)[rests]
            assert np.median(knees) < 2e-3
            assert knees.max() < 0.02
            assert np.count_nonzero(rests) >= UP.start - DOWN.stop


def test_without_the_rule_the_knees_miss_the_floor(solver, tmp_path, monkeypatch):
    def none_rests(motion, _):
        return np.zeros((motion.num_frames, 2), bool)

    monkeypatch.setattr("kine2go_warp.motions.retarget.resting_ends", none_rests)
    apart = distances(clip_of(gone_down(("rear",)), tmp_path, solver))
    knees = np.stack([apart[f"{leg}_thigh_capsule"] for leg in LEGS[2:]], axis=1)
    assert np.abs(knees).min() > 0.02


def test_a_mirrored_animal_rests_as_its_mirror_image(solver, tmp_path):
    points = gone_down(("rear",))
    points[:, COLUMN_OF_KEYPOINT["RL_toe"], 0] += 0.02
    one = clip_of(points, tmp_path, solver)
    swapped = points * (1.0, -1.0, 1.0)
    for kind in ("hip", "toe"):
        for left, right in (("FL", "FR"), ("RL", "RR")):
            columns = [COLUMN_OF_KEYPOINT[f"{leg}_{kind}"] for leg in (left, right)]
            swapped[:, columns] = swapped[:, columns[::-1]]
    other = mirror_image(clip_of(swapped, tmp_path, solver))
    np.testing.assert_allclose(other.root_position, one.root_position, atol=2e-3)
    np.testing.assert_allclose(other.joint_position, one.joint_position, atol=0.04)


def test_parts_may_touch_the_ground_a_little_before_and_after_they_rest(low):
    clip, _, _ = low
    frames = np.flatnonzero(clip.body_rests.any(axis=1))
    early = round(CONTACT_TOLERANCE / clip.frame_duration)
    expected = np.zeros(clip.num_frames, bool)
    expected[max(frames[0] - early, 0) : frames[-1] + early + 1] = True
    np.testing.assert_array_equal(clip.body_may_touch, expected)


def test_what_rests_is_a_part_of_the_clip_and_of_its_file(low, tmp_path):
    clip, _, _ = low
    clip.save(tmp_path / "low.npz")
    np.testing.assert_array_equal(MotionClip.load(tmp_path / "low.npz").body_rests, clip.body_rests)
    upright = replace(clip, body_rests=np.zeros_like(clip.body_rests))
    assert upright.content_hash() != clip.content_hash()
    with np.load(tmp_path / "low.npz") as data:
        arrays = {name: data[name] for name in data if name != "body_rests"}
    np.savez(tmp_path / "older.npz", **arrays)
    assert MotionClip.load(tmp_path / "older.npz").content_hash() == upright.content_hash()


POSTURES = [name for name, entry in load_catalogue().items() if entry.collection == "ai4animation_postures"]


@pytest.mark.parametrize("name", POSTURES)
def test_real_dogs_sit_on_the_floor_and_neither_in_nor_above_it(name, data_folder, solver):
    result = retarget(motion_named(name), data_folder, solver, RetargetConfig())
    clip, apart = result.clip, distances(result.clip)
    assert min(distance.min() for distance in apart.values()) > -1e-3
    feet = np.stack([apart[f"{leg}_foot_sphere"] for leg in LEGS], axis=1)
    assert np.abs(feet[clip.stance > 0.5]).max() < 1e-3
    assert clip.fidelity.contact_slip < 0.03
    assert clip.residual.max() < 1e-3
    rests = clip.body_rests[:, 1] > 0.5
    hocks = np.stack([apart[f"{leg}_thigh_capsule"] for leg in LEGS[2:]], axis=1)[rests]
    assert np.median(hocks) < 2e-3


def test_a_posture_that_is_not_held_long_enough_to_come_to_rest_is_refused(data_folder, solver):
    entry = entry_of("ai4animation/dog_walk06_joint_pos.txt", start=435, end=479)
    with pytest.raises(ClipError, match=r"moves at 0\.4.* rad/s or m/s at an end; hold its ends for longer"):
        retarget(replace(entry, kind="once", hold=0.5), data_folder, solver, RetargetConfig())
    assert retarget(replace(entry, kind="once", hold=1.0), data_folder, solver, RetargetConfig()).clip.kind == "once"
