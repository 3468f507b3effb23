"""Mirrored twins: left and right exchanged, by a recipe, a catalogue or an option."""

from dataclasses import fields, replace

import numpy as np
import placo
import pytest

from kine2go_warp.cli.main import main
from kine2go_warp.errors import CatalogueError
from kine2go_warp.motions.catalogue import own_catalogue
from kine2go_warp.motions.catalogue_entry import CatalogueEntry
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.motions.generator import DogGait, generate, write_ai4animation
from kine2go_warp.motions.own_file import OwnFile
from kine2go_warp.motions.retarget import retarget
from kine2go_warp.motions.variation import mirror_image
from kine2go_warp.pipelines.recipe import load_recipe
from kine2go_warp.robots import GO2

TABLE = """
name = "mine"
[[motion]]
name = "dog"
file = "dog.txt"
source = "ai4animation"
start = 40
end = 70
licence = "own"
citation = "me"
mirror = true
rate = 60.0
"""


@pytest.fixture(scope="module")
def pair(tmp_path_factory, solver) -> tuple[MotionClip, MotionClip]:
    """A clip of a dog that trots along a curve, and its twin."""
    path = tmp_path_factory.mktemp("dog") / "dog.txt"
    write_ai4animation(generate(DogGait(turn_rate=0.8, brisk=True), 120).points, path)
    entry = OwnFile(path, "own").entry()
    entry = replace(entry, frames=replace(entry.frames, start=40, end=70))
    one, twin = (retarget(each, None, solver, RetargetConfig()).clip for each in (entry, entry.twin()))
    return one, twin


def link_positions(clip: MotionClip, links: list[str]) -> np.ndarray:
    """Where placo has the links [m], shape [num_frames, num_links, 3]."""
    robot = placo.RobotWrapper(str(GO2.urdf), placo.Flags.ignore_collisions)
    slots = [robot.get_joint_offset(joint) for joint in GO2.joint_names]
    places = np.empty((clip.num_frames, len(links), 3))
    for frame in range(clip.num_frames):
        robot.state.q[:3] = clip.root_position[frame]
        robot.state.q[3:7] = clip.root_orientation[frame, [1, 2, 3, 0]]
        robot.state.q[slots] = clip.joint_position[frame]
        robot.update_kinematics()
        places[frame] = [robot.get_T_world_frame(link)[:3, 3] for link in links]
    return places


def test_every_link_of_the_twin_is_where_the_other_side_s_was(pair):
    clip, twin = pair
    links = [*GO2.leg_links, *GO2.foot_links, GO2.base_link]
    others = [link.translate(str.maketrans("LR", "RL")) if link[:2] in ("FL", "FR") else link for link in links]
    others = [f"R{'LR'['RL'.index(link[1])]}{link[2:]}" if link[:2] in ("RL", "RR") else link for link in others]
    ours, theirs = link_positions(clip, others), link_positions(twin, links)
    np.testing.assert_allclose(theirs, ours * [1.0, -1.0, 1.0], atol=1e-12)
    # It is another motion: the clip turns to its left, the twin to its right.
    assert clip.cycle.yaw == pytest.approx(0.4, abs=0.02)
    assert twin.cycle.yaw == -clip.cycle.yaw
    assert np.abs(theirs - link_positions(clip, links)).max() > 0.01


def test_velocities_and_points_of_the_animal_are_mirrored_with_the_poses(pair):
    clip, twin = pair
    np.testing.assert_allclose(twin.root_linear_velocity, clip.root_linear_velocity * [1, -1, 1], atol=1e-9)
    np.testing.assert_allclose(twin.root_angular_velocity, clip.root_angular_velocity * [-1, 1, -1], atol=1e-9)
    np.testing.assert_array_equal(twin.stance, clip.stance[:, [1, 0, 3, 2]])
    ours, theirs = clip.keypoints, twin.keypoints
    for name, other in (("FL_toe", "FR_toe"), ("RR_hip", "RL_hip"), ("neck", "neck")):
        expected = ours.position[:, ours.names.index(other)] * [1.0, -1.0, 1.0]
        np.testing.assert_array_equal(theirs.position[:, theirs.names.index(name)], expected)


def test_mirrored_twice_is_the_clip_bit_for_bit(pair):
    clip, _ = pair
    twice = mirror_image(mirror_image(clip))
    for field in fields(clip):
        ours, theirs = getattr(clip, field.name), getattr(twice, field.name)
        if isinstance(ours, np.ndarray):
            np.testing.assert_array_equal(theirs, ours)
    assert twice.cycle == clip.cycle
    np.testing.assert_array_equal(twice.keypoints.position, clip.keypoints.position)


def test_a_table_gives_two_motions_to_a_catalogue_and_to_a_recipe(tmp_path):
    (tmp_path / "mine.toml").write_text(TABLE)
    entries = own_catalogue(tmp_path / "mine.toml")
    assert [(name, entry.mirrored) for name, entry in entries.items()] == [("dog", False), ("dog_mirrored", True)]
    assert isinstance(entries["dog"], CatalogueEntry)
    assert load_recipe(tmp_path / "mine.toml").motions == ("dog", "dog_mirrored")
    (tmp_path / "mine.toml").write_text(TABLE + TABLE.replace('name = "mine"', "").replace('"dog"', '"dog_mirrored"'))
    with pytest.raises(CatalogueError, match="a second motion 'dog_mirrored'"):
        own_catalogue(tmp_path / "mine.toml")


def test_an_option_makes_the_twin_of_a_file(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_ai4animation(generate(DogGait(turn_rate=0.8, brisk=True), 120).points, tmp_path / "dog.txt")
    command = ["motion", "retarget", "dog.txt", "--frames", "40:70", "--licence", "own", "--mirror", "--out", "clips"]
    assert main(command) == 0, capsys.readouterr().err
    clip, twin = (MotionClip.load(tmp_path / "clips" / f"{name}.npz") for name in ("dog", "dog_mirrored"))
    np.testing.assert_array_equal(twin.root_position, clip.root_position * [1.0, -1.0, 1.0])
