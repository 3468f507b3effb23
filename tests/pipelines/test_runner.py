import json
import os
from dataclasses import replace
from pathlib import Path

import pytest

from kine2go_warp.dataset.motion import Motion
from kine2go_warp.dataset.reviews import REJECTED, add_reviews, new_review
from kine2go_warp.dataset.summary import summarise
from kine2go_warp.errors import CatalogueError, PipelineError
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.pipelines.workspace import Workspace
from tests.pipelines.helpers import TINY, TWO, content, run, write_sources

ALL = ["retarget", "train", "gather", "score", "record"]


def stages(listener):
    return [stage for _, stage in listener.stages]


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    result, listener = run(TINY, folder)
    return folder, result, listener


def contents(folder: Path):
    """Every file of a run that a second run must leave as it is."""
    return {
        path: (path.lstat().st_mtime_ns, path.read_bytes())
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in ("run.json", ".lock")
    }


def test_all_stages_leave_their_results(finished):
    folder, result, listener = finished
    assert stages(listener) == ALL
    assert (result.finished, result.failed, result.stopped) == (("dog_trot",), {}, ())
    names = ["artefacts", "clips", "dataset.zarr", "logs", "policies", "progress", "recordings", "run.json", "scores"]
    assert sorted(path.name for path in folder.iterdir() if path.name != ".lock") == names
    assert summarise(folder / "dataset.zarr")[0].total == 3
    workspace = Workspace(folder)
    assert MotionClip.load(workspace.clip("dog_trot")).name == "dog_trot"
    assert json.loads(workspace.scores("dog_trot").read_text())["motions"]["dog_trot"]["trajectories"] == 3
    assert workspace.recording("dog_trot").stat().st_size > 1000
    assert {path.name for path in (folder / "artefacts").iterdir()} == set(ALL)
    assert "train done" in workspace.log("dog_trot").read_text()


def test_the_resolved_recipe_the_software_and_the_machine_are_kept(finished):
    folder, *_ = finished
    record = json.loads((folder / "run.json").read_text())
    assert record["recipe"]["gather"]["trajectories"] == 3
    assert record["recipe"]["train"]["preset"] == "fast"
    assert record["machine"]["newton"]
    assert "software_revision" in record


def test_a_second_run_changes_nothing(finished):
    folder, *_ = finished
    before = contents(folder)
    result, listener = run(TINY, folder)
    assert listener.stages == []
    assert result.finished == ("dog_trot",)
    assert contents(folder) == before


def test_a_finished_motion_tells_its_figures(finished):
    *_, listener = finished
    (event,) = listener.of("motion_finished")
    assert event.metrics["accepted"] == 3
    assert 0.0 < event.metrics["joint_rmse"] < 1.0


@pytest.mark.parametrize(
    ("change", "redone"),
    [
        (lambda recipe: replace(recipe, record=replace(recipe.record, trajectories=2)), ["record"]),
        (lambda recipe: replace(recipe, gather=replace(recipe.gather, rows=15)), ["gather", "score", "record"]),
        (lambda recipe: replace(recipe, train=recipe.train.override({"env.seed": 2})), ALL[1:]),
        (lambda recipe: replace(recipe, retarget=replace(recipe.retarget, mode="plain")), ALL),
    ],
    ids=["record", "gather", "train", "retarget"],
)
def test_a_changed_setting_redoes_what_depends_on_it_and_nothing_else(finished, change, redone):
    folder, *_ = finished
    before = contents(folder / "artefacts")
    _, listener = run(change(TINY), folder)
    assert stages(listener) == redone
    after = contents(folder / "artefacts")
    assert before.items() <= after.items(), "artefacts are never changed"
    # The artefacts of the first settings are still there.
    _, listener = run(TINY, folder)
    assert listener.stages == []


def test_the_dataset_follows_the_recipe_back_and_forth(finished):
    folder, *_ = finished
    run(TINY, folder)
    first = content(folder)
    run(replace(TINY, gather=replace(TINY.gather, seed=9)), folder)
    assert content(folder) != first
    run(TINY, folder)
    assert content(folder) == first


def test_a_clip_that_comes_out_the_same_is_not_trained_on_again(finished):
    folder, *_ = finished
    # Without contacts the clip does not depend on the clearance of the swing.
    plain = replace(TINY, retarget=replace(TINY.retarget, mode="plain"))
    run(plain, folder)
    _, listener = run(replace(plain, retarget=replace(plain.retarget, swing_clearance=0.02)), folder)
    assert stages(listener) == ["retarget"]


def test_more_iterations_continue_the_policy_that_is_there(finished, tmp_path):
    folder, *_ = finished
    longer = replace(TINY, train=TINY.train.override({"ppo.iterations": 4}))
    result, _ = run(longer, folder)
    assert result.failed == {}
    assert f"{longer.train.ppo.iterations}" in Workspace(folder).log("dog_trot").read_text()
    run(longer, tmp_path)
    assert content(folder) == content(tmp_path), "the same as at once"


def test_a_verdict_redoes_scores_and_recording(tmp_path):
    run(TINY, tmp_path)
    dataset = Workspace(tmp_path).dataset
    motion = Motion(dataset, "dog_trot")
    trajectory = next(iter(motion.read(motion.references()[:1], None)))
    add_reviews(dataset, [new_review(trajectory, REJECTED, "drags a foot", "Ada")])
    _, listener = run(TINY, tmp_path)
    assert stages(listener) == ["score", "record"]
    scores = json.loads(Workspace(tmp_path).scores("dog_trot").read_text())
    assert scores["motions"]["dog_trot"]["trajectories"] == 2


def test_a_motion_that_fails_does_not_stop_the_others(tmp_path):
    data = write_sources(tmp_path / "data")
    (data / "ai4animation" / "dog_walk00_joint_pos.txt").write_text("not a motion\n")
    recipe = replace(TWO, motions=tuple(reversed(TWO.motions)))
    result, listener = run(recipe, tmp_path / "run", data)
    assert result.finished == ("dog_trot",)
    (failure,) = result.failed.values()
    assert failure.stage == "retarget"
    assert "dog_walk00_joint_pos.txt" in failure.why
    assert "failed" in failure.log.read_text()
    (event,) = listener.of("motion_failed")
    assert str(failure.log) in event.detail


def test_a_missing_source_clip_fails_its_motion_alone(tmp_path):
    result, _ = run(TWO, tmp_path / "run", tmp_path)
    assert result.finished == ("dog_trot",)
    assert "no such motion file" in result.failed["ai4_dog_pace"].why


def test_rollouts_that_are_all_rejected_fail_the_motion_and_a_looser_limit_goes_on_from_the_policy(tmp_path):
    strict = replace(TINY, gather=replace(TINY.gather, max_distance=1e-6))
    result, _ = run(strict, tmp_path)
    assert "all 12 rollouts were rejected" in result.failed["dog_trot"].why
    assert Workspace(tmp_path).failure("dog_trot").is_file()
    result, listener = run(TINY, tmp_path)
    assert result.finished == ("dog_trot",)
    assert stages(listener) == ["gather", "score", "record"]
    assert not Workspace(tmp_path).failure("dog_trot").exists()


@pytest.mark.parametrize("motion", ["unknown", "ai4_dog_pace"])
def test_an_unknown_motion_or_missing_data_folder_stops_before_anything_is_written(tmp_path, motion):
    with pytest.raises(CatalogueError):
        run(replace(TINY, motions=("dog_trot", motion)), tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_motions_that_were_simulated_otherwise_leave_the_dataset_and_their_artefacts_stay(tmp_path):
    data = write_sources(tmp_path / "data")
    folder = tmp_path / "run"
    run(TWO, folder, data)
    first = content(folder)
    papers = replace(TWO, train=replace(TWO.train, preset="paper"))
    result, _ = run(papers, folder, data)
    assert result.failed == {}
    assert sorted(one.motion for one in summarise(Workspace(folder).dataset)) == sorted(TWO.motions)
    _, listener = run(TWO, folder, data)
    assert listener.stages == []
    assert content(folder) == first


def test_two_runs_on_one_folder_are_refused_with_who_is_there(tmp_path):
    folder = tmp_path / "run"
    with Workspace(folder).alone(), pytest.raises(PipelineError, match=f"process {os.getpid()} on .* since"):
        run(TINY, folder)
    assert not (folder / "artefacts").exists()
    result, _ = run(TINY, folder)
    assert result.finished == ("dog_trot",)


def test_a_run_that_is_stopped_between_stages_goes_on_where_it_was(tmp_path):
    recipe = replace(TINY, train=TINY.train.override({"ppo.iterations": 6}))
    looks = iter(range(100))
    workspace = Workspace(tmp_path / "stopped")
    result, _ = run(recipe, workspace.root, should_stop=lambda: next(looks) >= 1)
    assert result.stopped == ("dog_trot",)
    assert not workspace.stop_file.exists()
    result, listener = run(recipe, workspace.root)
    assert stages(listener) == ALL[1:]
    run(recipe, tmp_path / "whole")
    assert content(workspace.root) == content(tmp_path / "whole")


def test_a_file_of_the_users_own_in_the_place_of_a_result_is_set_aside(finished):
    folder, *_ = finished
    place = Workspace(folder).clip("dog_trot")
    place.unlink()
    place.write_text("mine")
    run(TINY, folder)
    assert MotionClip.load(place).name == "dog_trot"
    assert place.with_name("dog_trot.npz.older-1").read_text() == "mine"
