"""Running recipes from the command line: what is told, and what 'status' says before and after."""

import json
from dataclasses import replace

import pytest
from rich.console import Console

from kine2go_warp.cli.main import main
from kine2go_warp.cli.run_progress import LiveTable, duration, sentence
from kine2go_warp.cli.status import MotionStatus, results_table
from kine2go_warp.pipelines.artefacts import read_record
from kine2go_warp.pipelines.events import Event
from kine2go_warp.pipelines.stages import STAGES
from kine2go_warp.pipelines.workspace import Workspace
from tests.pipelines.helpers import TINY

LIMITS = [f"gather.{name}={value}" for name, value in vars(TINY.gather).items() if name.startswith("max_")]
SETTINGS = ["--iterations", "2", "--trajectories", "3", "--rows", "20", "--device", "cpu"]
SETTINGS += ["--set", "train.env.num_worlds=8", "gather.warm_up=0.1", "record.trajectories=1", *LIMITS]


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run") / "tiny"
    assert main(["run", "demo", "--out", str(folder), "--workers", "0", *SETTINGS]) == 0
    return folder


def test_json_events_tell_what_happens(finished, capsys):
    capsys.readouterr()
    other = ["--out", str(finished), "--workers", "0", "--json", *SETTINGS, "gather.seed=7"]
    assert main(["run", "demo", *other]) == 0
    events = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [event["kind"] for event in events if event["kind"] != "progress"] == [
        "run_started",
        *["stage_started", "stage_finished"] * 3,
        "motion_finished",
        "run_finished",
    ]
    assert {"gather", "score", "record"} == {event["stage"] for event in events if event["kind"] == "stage_started"}
    (finish,) = (event for event in events if event["kind"] == "motion_finished")
    assert finish["metrics"]["accepted"] == 3
    assert events[-1]["metrics"] == {"finished": 1, "failed": 0, "stopped": 0}
    assert all(event["time"] > 1.7e9 for event in events)


def test_status_says_that_all_is_done(finished, capsys):
    capsys.readouterr()
    assert main(["status", "demo", "--out", str(finished), *SETTINGS]) == 0
    shown = capsys.readouterr().out
    assert "everything is done" in shown
    assert all(stage.name in shown for stage in STAGES)


def test_status_writes_the_results_as_a_table(finished, tmp_path):
    path = tmp_path / "results.md"
    assert main(["status", "demo", "--out", str(finished), "--markdown", str(path), *SETTINGS]) == 0
    heading, _, row, total = path.read_text().splitlines()
    cells = dict(zip(heading.strip("| ").split(" | "), row.strip("| ").split(" | "), strict=True))
    assert (cells["motion"], cells["iterations"], cells["stopped because"]) == ("`dog_trot`", "2", "budget")
    assert cells["accepted"].startswith("3 of ")
    record = read_record(next((finished / "artefacts" / "train").glob("dog_trot-*")) / "artefact.json")
    assert record.core_seconds > 0.0
    assert all(float(cells[name]) > 0.0 for name in ("joint RMSE [rad]", "root error [cm]", "power [W]", "core [min]"))
    assert total.startswith("| 1 of 1 motions done |")


def test_the_results_say_why_rollouts_were_rejected_or_a_motion_failed():
    metrics = {"accepted": 20, "rejected": 3, "reasons": {"foot_slip": 2, "distance": 1}, "stopped": "targets reached"}
    good = MotionStatus("dog_trot", metrics=metrics, seconds=120.0, core_seconds=90.0)
    failed = MotionStatus("ai4_dog_canter", next_stage="gather", failure="gather: all 80 rollouts were rejected")
    *_, first, second, total = results_table([good, failed]).splitlines()
    assert "| targets reached | 20 of 23 (rejected: foot slip 2, distance 1) |" in first
    assert "| gather: all 80 rollouts were rejected |" in second
    assert total.startswith("| 1 of 2 motions done |")
    assert total.endswith("| 2.0 | 1.5 |")


def test_status_says_what_a_changed_setting_would_cost_and_changes_nothing(finished, capsys):
    before = sorted(finished.rglob("*"))
    capsys.readouterr()
    assert main(["status", "demo", "--out", str(finished), "--json", *SETTINGS, "train.env.seed=5"]) == 0
    (motion,) = json.loads(capsys.readouterr().out)["motions"]
    assert motion["next_stage"] == "train"
    assert "settings.env.seed 1 -> 5" in motion["why"]
    assert (motion["stages"]["train"], motion["stages"]["gather"]) == ("to do", "-")
    assert motion["metrics"]["frames"] == 30
    assert sorted(finished.rglob("*")) == before


def test_status_before_the_first_run_writes_nothing(tmp_path, capsys):
    assert main(["status", "demo", "--out", str(tmp_path / "run"), "--device", "cpu"]) == 0
    assert "dog_trot: would run retarget: not made yet" in capsys.readouterr().out
    assert list(tmp_path.iterdir()) == []


def test_status_names_missing_source_clips(tmp_path, capsys):
    assert main(["status", "sample", "--out", str(tmp_path / "run"), "--data", str(tmp_path), "--device", "cpu"]) == 0
    assert "solo8_crawl_fast: would run retarget: " in (shown := capsys.readouterr().out)
    assert "no such motion file" in shown


def test_motions_are_named_by_patterns_as_in_a_recipe(tmp_path, capsys):
    options = ["--out", str(tmp_path / "run"), "--data", str(tmp_path), "--device", "cpu", "--json"]
    assert main(["status", "demo", "--motions", "vhdc_*_walk_*", *options]) == 0
    motions = json.loads(capsys.readouterr().out)["motions"]
    assert [motion["motion"][-7:] for motion in motions] == ["walk_01", "walk_02", "walk_03"] * 2


def test_a_failed_motion_is_told_with_its_log_by_run_and_status(tmp_path, capfd):
    folder = tmp_path / "run"
    options = ["--out", str(folder), "--data", str(tmp_path), "--device", "cpu"]
    assert main(["run", "demo", "--motions", "ai4_dog_pace", "--workers", "0", *options]) == 2
    errors = capfd.readouterr().err
    log = Workspace(folder).log("ai4_dog_pace")
    assert "kine2go: error: ai4_dog_pace: retarget: " in errors
    assert f"(log: {log})" in errors
    assert main(["status", "demo", "--motions", "ai4_dog_pace", *options]) == 0
    assert "ai4_dog_pace: failed last time at retarget" in capfd.readouterr().out


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--workers", "2", "--ray", "auto"], "either --workers or --ray"),
        (["--workers", "-1"], "--workers must be 0 or more"),
        (["--set", "train.speed=1"], "unknown key"),
        (["--motions", "cat_*"], "'motions' has 'cat_*', and the catalogue no motion of such a name"),
    ],
)
def test_options_that_make_no_sense_are_refused_before_anything_is_written(tmp_path, capsys, options, message):
    assert main(["run", "demo", "--out", str(tmp_path / "run"), *options]) == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_the_live_table_shows_where_each_motion_is():
    console = Console(width=140, record=True, force_terminal=True)
    table = LiveTable(console)
    training = Event("progress", "dog_trot", "train", "reward 9.10", 40, 120, 60.0, 120.0, {"reward": 9.1})
    table.on_event(Event("stage_started", "ai4_dog_pace", "train", "not made yet"))
    table.on_event(training)
    table.on_event(Event("motion_failed", "ai4_dog_run_00", "gather", "all 80 rollouts were rejected"))
    console.print(table._table())
    shown = console.export_text()
    assert all(text in shown for text in ("dog_trot", "40/120", "9.10", "2 min 00 s"))
    assert "preparing (kernels compile once" in shown
    assert "kine2go: error: ai4_dog_run_00: gather: all 80 rollouts were rejected" in shown
    table.on_event(replace(training, kind="stage_finished"))
    assert "40/120" not in str(list(table._table().columns[2].cells))


def test_times_are_told_in_words():
    assert [duration(seconds) for seconds in (None, 3.21, 42.0, 125.0, 7260.0)] == [
        "", "3.2 s", "42 s", "2 min 05 s", "2 h 01 min"]  # fmt: skip
    assert sentence(Event("run_finished", seconds=65.0, metrics={"finished": 2, "failed": 1})) == (
        "2 finished, 1 failed in 1 min 05 s"
    )
