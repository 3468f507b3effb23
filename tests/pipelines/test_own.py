"""The recipe of motions that are in no catalogue: a BVH file, one of AMP's, a sit, a leap, and a sequence."""

from pathlib import Path

import numpy as np
import pytest

from kine2go_warp.motions.catalogue import load_catalogue
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.motions.quality import assess, clip_faults
from kine2go_warp.motions.retarget import retarget
from kine2go_warp.pipelines.recipe import load_recipe
from kine2go_warp.robots import GO2
from tests.conftest import REPOSITORY
from tests.motions.sources.own_examples import WRITERS
from tests.motions.test_body_contact import distances

RECIPE = REPOSITORY / "kine2go_warp" / "pipelines" / "own.toml"
KINDS = {"hound_trot": "cycle", "go2_pace": "cycle", "sit_and_stand": "once", "leap": "once", "outing": "once"}


@pytest.mark.parametrize("file", WRITERS)
def test_its_files_are_the_generated_ones(file, tmp_path):
    WRITERS[file](tmp_path / file)
    assert (REPOSITORY / "motions" / "data" / file).read_bytes() == (tmp_path / file).read_bytes()


def test_it_has_a_motion_of_each_kind():
    assert load_recipe(Path("own")).motions == tuple(KINDS)


@pytest.fixture(scope="module")
def results(solver):
    entries = load_catalogue(RECIPE)
    return {name: retarget(entries[name], None, solver, RetargetConfig()) for name in KINDS}


@pytest.mark.parametrize("name", KINDS)
def test_its_clips_are_without_faults(results, name):
    made = results[name]
    assert clip_faults(assess(made, GO2)) == []
    assert made.clip.kind == KINDS[made.clip.name]
    assert min(apart.min() for apart in distances(made.clip).values()) > -1e-3


def test_who_sits_alone_sits_within_a_sequence(results):
    for clip in (results["sit_and_stand"].clip, results["outing"].clip):
        seconds = clip.frame_duration * clip.body_rests.sum(axis=0)
        assert seconds[0] == 0.0
        assert seconds[1] > 0.5
        apart = distances(clip)
        knees = np.stack([apart[f"{leg}_thigh_capsule"] for leg in ("RL", "RR")], axis=1)
        assert np.median(knees[clip.body_rests[:, 1] > 0.5]) < 6e-3


def test_a_leap_falls_freely(results):
    clip = results["leap"].clip
    flying = np.flatnonzero(clip.stance.sum(axis=1) == 0)[2:-2]
    assert len(flying) * clip.frame_duration > 0.1
    up = np.diff(clip.root_position[:, 2], 2)[flying - 1] / clip.frame_duration**2
    np.testing.assert_allclose(up, -9.81, rtol=0.05)
