from pathlib import Path

import numpy as np
import pytest

from kine2go_warp.errors import CatalogueError, ClipError
from kine2go_warp.motions.catalogue import load_catalogue, motion_named
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.motions.retarget import retarget
from kine2go_warp.robots import GO2


def test_the_papers_tables_are_in_the_catalogue():
    canter = motion_named("ai4_dog_canter")
    assert (canter.file, canter.frames.start, canter.frames.end, canter.length, canter.sample) == (
        "ai4animation/dog_run00_joint_pos.txt",
        430,
        459,
        571,
        True,
    )
    dogs = [entry for entry in load_catalogue().values() if entry.name.startswith("ai4_dog")]
    assert len(dogs) == 22
    assert sum(entry.sample for entry in dogs) == 4
    assert all(entry.licence and entry.citation for entry in load_catalogue().values())


def test_an_unknown_motion_brings_similar_names():
    with pytest.raises(CatalogueError, match=r"unknown motion 'ai4-dog-trot'; .*ai4_dog_trot_00|dog_trot"):
        motion_named("ai4-dog-trot")


def test_a_motion_without_data_folder_says_how_to_name_one():
    with pytest.raises(CatalogueError, match="--data"):
        motion_named("ai4_dog_pace").path(None)


def test_a_missing_file_is_named(solver, tmp_path):
    with pytest.raises(ClipError, match=r"dog_walk00_joint_pos\.txt: no such motion file"):
        retarget(motion_named("ai4_dog_pace"), tmp_path, solver, RetargetConfig())


@pytest.mark.parametrize("name", [name for name in load_catalogue() if name.startswith("ai4")])
def test_every_real_dog_becomes_a_usable_clip(name, data_folder: Path, solver):
    clip = retarget(motion_named(name), data_folder, solver, RetargetConfig())
    assert clip.residual.max() < 1e-3
    assert np.all(clip.joint_position >= np.array(GO2.joint_lower) - 1e-6)
    assert np.all(clip.joint_position <= np.array(GO2.joint_upper) + 1e-6)
    assert np.abs(clip.joint_velocity).max() < 20.07, "within the slowest motor's speed"
    assert (clip.foot_position[..., 2] - GO2.foot_radius).min() > -0.02
    assert 0.25 < clip.root_position[:, 2].mean() < 0.4
    speed = np.linalg.norm(clip.root_linear_velocity[:, :2], axis=1).mean()
    assert 0.1 < speed < 3.0
