"""Case run-trains-faulty-clip: a run assesses the clips that it would train on."""

from dataclasses import replace

import pytest

from kine2go_warp.errors import RecipeError
from kine2go_warp.motions.generator import DogGait, generate, write_ai4animation
from kine2go_warp.motions.sources.ai4animation import COLUMN_OF_KEYPOINT
from kine2go_warp.pipelines.job import Job, Monitor
from kine2go_warp.pipelines.recipe import load_recipe
from kine2go_warp.pipelines.stages.retarget import RetargetStage
from kine2go_warp.pipelines.workspace import Workspace
from tests.pipelines.helpers import TINY, run

FAULTY = replace(TINY, motions=("ai4_dog_pace",))


@pytest.fixture
def data(tmp_path):
    """A dog whose left fore foot is 1 m ahead of where it belongs."""
    file = tmp_path / "data" / "ai4animation" / "dog_walk00_joint_pos.txt"
    file.parent.mkdir(parents=True)
    points = generate(DogGait(), 240).points
    points[:, COLUMN_OF_KEYPOINT["FL_toe"], 0] += 1.0
    write_ai4animation(points, file)
    return tmp_path / "data"


def test_a_clip_with_a_gross_fault_fails_before_training(tmp_path, data):
    result, listener = run(FAULTY, tmp_path / "run", data)
    failure = result.failed["ai4_dog_pace"]
    assert failure.stage == "retarget"
    assert "unfit for training" in failure.why
    assert "out of reach" in failure.why
    assert 'accept = ["ai4_dog_pace"]' in failure.why
    assert "out of reach" in failure.log.read_text()
    assert listener.stages == [("ai4_dog_pace", "retarget")]


def test_a_recipe_accepts_it_by_name_and_its_faults_are_kept(tmp_path, data):
    recipe = replace(FAULTY, accept=("ai4_dog_pace",))
    job = Job("ai4_dog_pace", recipe, Workspace(tmp_path / "run"), data, "cpu")
    (tmp_path / "made").mkdir()
    job.workspace.log(job.motion).parent.mkdir(parents=True)
    job.workspace.progress(job.motion).parent.mkdir(parents=True, exist_ok=True)
    made = RetargetStage().make(job, {}, tmp_path / "made", Monitor(job, "retarget"))
    assert any("out of reach" in remark for remark in made.metrics["clip_remarks"])
    assert RetargetStage().inputs(job, {})["accepted"]


def test_names_to_accept_are_among_the_motions(tmp_path):
    (tmp_path / "a.toml").write_text("name = 'a'\nmotions = ['dog_trot']\naccept = ['dog_tort']\n")
    with pytest.raises(RecipeError, match=r"line 3.*'accept' names dog_tort"):
        load_recipe(tmp_path / "a.toml")
