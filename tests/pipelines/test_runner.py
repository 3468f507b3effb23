from dataclasses import replace
from pathlib import Path

import pytest

from kine2go_warp.dataset.summary import summarise
from kine2go_warp.errors import CatalogueError, ClipError
from kine2go_warp.learning.config import TrainConfig
from kine2go_warp.pipelines.recipe import Recipe, RecordConfig
from kine2go_warp.pipelines.runner import RecipeRunner, RunObserver, Workspace
from kine2go_warp.rollouts.config import GatherConfig
from tests.conftest import ANYTHING_GOES

TINY = Recipe(
    name="tiny",
    motions=("dog_trot",),
    train=TrainConfig(num_worlds=8, iterations=1),
    gather=GatherConfig(trajectories=3, rows=20, **ANYTHING_GOES),
    record=RecordConfig(trajectories=1),
)


class Listener(RunObserver):
    def __init__(self):
        self.stages, self.errors = [], []

    def stage(self, motion, stage):
        self.stages.append((motion, stage))

    def failed(self, motion, error):
        self.errors.append((motion, type(error)))


def run(recipe, folder, data=None):
    listener = Listener()
    result = RecipeRunner(recipe, Workspace(folder), data, "cpu", listener).run()
    return result, listener


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    result, listener = run(TINY, folder)
    return folder, result, listener


def test_all_stages_leave_their_results(finished):
    folder, result, listener = finished
    assert [stage for _, stage in listener.stages] == ["retarget", "train", "gather", "record"]
    assert (result.finished[0].accepted, result.failed) == (3, ())
    assert sorted(path.name for path in folder.iterdir()) == [
        "clips",
        "dataset.zarr",
        "policies",
        "recipe.json",
        "recordings",
    ]
    assert summarise(folder / "dataset.zarr")[0].total == 3


def contents(folder: Path):
    return {
        path: (path.stat().st_mtime_ns, path.read_bytes())
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in ("recipe.json", "zarr.json", "policy.json")
    }


def test_a_second_run_changes_nothing(finished):
    folder, *_ = finished
    before = contents(folder)
    result, listener = run(TINY, folder)
    assert contents(folder) == before
    assert not result.finished[0].is_new
    assert ("dog_trot", "record") not in listener.stages


def test_a_changed_setting_redoes_what_depends_on_it(finished, tmp_path):
    del finished
    run(TINY, tmp_path)
    policy = Workspace(tmp_path).policy("dog_trot")
    before = contents(policy)
    result, _ = run(replace(TINY, gather=replace(TINY.gather, rows=10)), tmp_path)
    assert result.finished[0].is_new
    assert contents(policy) == before, "the policy is kept"
    run(replace(TINY, train=replace(TINY.train, seed=2)), tmp_path)
    assert contents(policy) != before


def test_a_motion_that_fails_does_not_stop_the_others(tmp_path):
    recipe = replace(TINY, motions=("ai4_dog_pace", "dog_trot"))
    result, listener = run(recipe, tmp_path / "run", tmp_path)
    assert result.failed == ("ai4_dog_pace",)
    assert [motion.motion for motion in result.finished] == ["dog_trot"]
    assert listener.errors == [("ai4_dog_pace", ClipError)]


@pytest.mark.parametrize("motion", ["unknown", "ai4_dog_pace"])
def test_an_unknown_motion_or_missing_data_folder_stops_before_anything_is_written(tmp_path, motion):
    with pytest.raises(CatalogueError):
        run(replace(TINY, motions=("dog_trot", motion)), tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_recording_that_shows_other_rollouts_is_made_again(tmp_path):
    run(TINY, tmp_path)
    recording = Workspace(tmp_path).recording("dog_trot")
    before = recording.read_bytes()
    # As after a kill between gathering and recording: the dataset is new, the recording is not.
    other = replace(TINY, gather=replace(TINY.gather, seed=9), record=RecordConfig(trajectories=0))
    run(other, tmp_path)
    assert recording.read_bytes() == before
    run(replace(other, record=TINY.record), tmp_path)
    assert recording.read_bytes() != before


def test_a_damaged_clip_in_the_workspace_is_made_again(finished):
    folder, *_ = finished
    Workspace(folder).clip("dog_trot").write_bytes(b"damaged")
    result, _ = run(TINY, folder)
    assert result.failed == ()
    assert not result.finished[0].is_new
