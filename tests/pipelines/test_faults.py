"""A run loses nothing: not by kills, a full disk, a read-only folder, damaged files, or a clock that jumps."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kine2go_warp.dataset.checks.run import check_dataset
from kine2go_warp.pipelines.artefacts import RECORD
from kine2go_warp.pipelines.engines.local import LocalEngine
from kine2go_warp.pipelines.job import read_progress
from kine2go_warp.pipelines.recipe import Recipe
from kine2go_warp.pipelines.workspace import Workspace
from kine2go_warp.robots import GO2
from tests.conftest import REPOSITORY
from tests.dataset.helpers import small_disk
from tests.killing import KillableWorker, spread_moments
from tests.pipelines.helpers import TINY, TWO, content, run, write_sources


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return write_sources(tmp_path_factory.mktemp("sources"))


def unfinished(folder: Path) -> str:
    """The stage that a killed run has left unfinished."""
    works = [path for path in (folder / "artefacts").glob("*/.work-*") if path.is_dir()]
    return works[0].parent.name if works else "between"


def kill_runs(data: Path, folder: Path, kills: int) -> None:
    """Kill runs, spread over their whole life, and run each again."""
    reference, landed = folder / "reference", Counter()
    with KillableWorker("tests.pipelines.run_process", data, reference) as runner:
        expected = content(reference)
        status, life = runner.ask(folder / "again")
        assert (status, content(folder / "again")) == (0, expected), "undisturbed runs agree"
        for number, moment in enumerate(spread_moments(kills)):
            place = folder / str(number)
            status, seconds = runner.ask(place, kill_after=life * moment)
            if not status:
                # The machine has become faster since the life was measured.
                life = min(life, seconds)
            landed[unfinished(place) if status else "after the end"] += 1
            assert runner.ask(place)[0] == 0
            assert content(place) == expected, "the next run completes it with the same bits"
            assert check_dataset(Workspace(place).dataset, GO2).is_clean
            assert not list((place / "artefacts").glob("*/.work-*"))
            shutil.rmtree(place)
    print(f"{kills} kills over {life:.1f} s: {dict(landed)}")
    assert landed["after the end"] <= kills // 2


def test_a_run_that_is_killed_at_any_moment_is_completed_by_the_next(data, tmp_path):
    kill_runs(data, tmp_path, 2)


@pytest.mark.faults
def test_a_run_that_is_killed_at_any_of_forty_moments_is_completed_by_the_next(data, tmp_path):
    kill_runs(data, tmp_path, 40)


class Killer:
    """Asked whether to stop, it kills the worker of a motion instead, once the motion has come to certain places."""

    def __init__(self, engine: LocalEngine, workspace: Workspace, places: list[tuple[str, str, int]]) -> None:
        self.engine, self.workspace, self.places = engine, workspace, places

    def __call__(self) -> bool:
        for place in list(self.places):
            motion, stage, done = place
            note = read_progress(self.workspace.progress(motion))
            worker = self.engine.worker_of(motion)
            if note is not None and worker is not None and note.stage == stage and note.done >= done:
                os.kill(worker.process.pid, signal.SIGKILL)
                self.places.remove(place)
                break
        return False


def kill_workers(recipe: Recipe, data: Path, folder: Path, places: list[tuple[str, str, int]]) -> None:
    recipe = replace(recipe, train=recipe.train.override({"ppo.iterations": 12}))
    engine = LocalEngine(len(recipe.motions), "cpu", folder / "logs")
    killer = Killer(engine, Workspace(folder / "killed"), list(places))
    result, listener = run(recipe, folder / "killed", data, engine, killer)
    assert result.failed == {}
    assert killer.places == []
    died = [(event.motion, event.stage) for event in listener.of("worker_died")]
    assert sorted(died) == sorted((motion, stage) for motion, stage, _ in places)
    run(recipe, folder / "whole", data)
    assert content(folder / "killed") == content(folder / "whole")


def test_a_worker_that_is_killed_is_replaced_and_changes_nothing(data, tmp_path):
    kill_workers(TINY, data, tmp_path, [("dog_trot", "train", 3)])


@pytest.mark.faults
def test_ten_workers_that_are_killed_are_replaced_and_change_nothing(data, tmp_path):
    rng = np.random.default_rng(0)
    for number in range(5):
        places = [(motion, "train", int(rng.integers(0, 8))) for motion in TWO.motions]
        kill_workers(TWO, data, tmp_path / str(number), places)


def test_a_stage_that_kills_every_worker_fails_its_motion(tmp_path):
    engine = LocalEngine(1, "cpu", tmp_path / "logs")
    deaths = 0

    def kill_trainings() -> bool:
        nonlocal deaths
        worker = engine.worker_of("dog_trot")
        if worker is not None and worker.stage == "train":
            os.kill(worker.process.pid, signal.SIGKILL)
            deaths += 1
        return False

    result, _ = run(TINY, tmp_path / "run", None, engine, kill_trainings)
    assert result.failed["dog_trot"].why.startswith("its worker died 3 times, last: worker 0 died (signal 9)")
    assert deaths >= 3


def workers_of(parent: int) -> list[int]:
    """Numbers of the processes that a process has started."""
    found = []
    for status in Path("/proc").glob("[0-9]*/status"):
        try:
            lines = dict(line.split(":\t", 1) for line in status.read_text().splitlines() if ":\t" in line)
        except OSError:
            continue
        if int(lines["PPid"]) == parent:
            found.append(int(lines["Pid"]))
    return found


def command(folder: Path, *options: str) -> list[str]:
    """The command that runs the demo in a few seconds."""
    code = "from kine2go_warp.cli.main import entry_point; entry_point()"
    loose = [f"gather.{name}={value}" for name, value in vars(TINY.gather).items() if name.startswith("max_")]
    settings = ["train.env.num_worlds=8", "gather.warm_up=0.1", *loose]
    sizes = ["--iterations", "400", "--trajectories", "3", "--rows", "20"]
    where = ["--out", str(folder), "--workers", "2", "--device", "cpu"]
    return [sys.executable, "-c", code, "run", "demo", *where, *sizes, "--set", *settings, *options]


def wait_for_training(folder: Path) -> None:
    progress, deadline = Workspace(folder).progress("dog_trot"), time.monotonic() + 120.0
    while not (progress.is_file() and '"stage": "train", "done": ' in progress.read_text() and
               '"done": 0' not in progress.read_text()):  # fmt: skip
        assert time.monotonic() < deadline
        time.sleep(0.1)


def is_alive(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def test_workers_end_with_the_run_that_is_killed(tmp_path):
    runner = subprocess.Popen(command(tmp_path), cwd=REPOSITORY, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    wait_for_training(tmp_path)
    workers = workers_of(runner.pid)
    assert workers
    runner.kill()
    runner.wait()
    deadline = time.monotonic() + 10.0
    while any(is_alive(worker) for worker in workers) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not any(is_alive(worker) for worker in workers)


def test_an_interrupt_writes_a_checkpoint_and_ends(tmp_path):
    quiet = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "cwd": REPOSITORY}
    runner = subprocess.Popen(command(tmp_path), **quiet)
    wait_for_training(tmp_path)
    runner.send_signal(signal.SIGINT)
    _, errors = runner.communicate(timeout=60)
    assert runner.returncode == 130, errors
    assert "the same command goes on from here" in errors
    (work,) = (tmp_path / "artefacts" / "train").glob(".work-*[0-9a-f]")
    done = max(int(path.stem.removeprefix("model_")) for path in work.glob("model_*.pt"))
    assert 0 < done < 399


@pytest.mark.faults
def test_two_interrupts_end_at_once(tmp_path):
    quiet = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "cwd": REPOSITORY}
    runner = subprocess.Popen(command(tmp_path), **quiet)
    wait_for_training(tmp_path)
    runner.send_signal(signal.SIGINT)
    runner.send_signal(signal.SIGINT)
    _, errors = runner.communicate(timeout=60)
    assert runner.returncode == 130, errors


def test_a_full_disk_fails_in_one_line_and_the_same_command_completes_later(tmp_path):
    with small_disk(tmp_path / "disk", 24) as disk:
        folder = disk.folder / "run"
        disk.leave(60 * 1024)
        result, _ = run(TINY, folder)
        assert "no space left on the disk" in result.failed["dog_trot"].why
        disk.free()
        result, _ = run(TINY, folder)
        assert result.failed == {}
        run(TINY, tmp_path / "whole")
        assert content(folder) == content(tmp_path / "whole")


def test_a_folder_that_cannot_be_written_fails_in_one_line(tmp_path, monkeypatch):
    # A real one would not stop root, as whom tests often run.
    def refuse(*_args, **_options):
        raise PermissionError(13, "Permission denied", str(tmp_path / "artefacts"))

    run(TINY, tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr("kine2go_warp.pipelines.artefacts.flush_folder", refuse)
        result, _ = run(replace(TINY, train=TINY.train.override({"env.seed": 5})), tmp_path)
        assert "no permission to write or read here" in result.failed["dog_trot"].why
    result, listener = run(TINY, tmp_path)
    assert listener.stages == []


def test_a_damaged_artefact_is_made_again(tmp_path):
    run(TINY, tmp_path)
    expected = content(tmp_path)
    (record,) = (tmp_path / "artefacts" / "gather").glob(f"dog_trot-*/{RECORD}")
    record.write_text("{")
    result, listener = run(TINY, tmp_path)
    assert [stage for _, stage in listener.stages] == ["gather"], "what it gives is the same"
    assert result.finished == ("dog_trot",)
    assert content(tmp_path) == expected


def test_clocks_that_jump_change_nothing(tmp_path, monkeypatch):
    run(TINY, tmp_path / "whole")
    real, jumps = time.time, iter(range(1, 1_000_000))
    monkeypatch.setattr(time, "time", lambda: real() + 86_400.0 * (-1) ** next(jumps))
    run(TINY, tmp_path / "jumping")
    assert content(tmp_path / "jumping") == content(tmp_path / "whole")
