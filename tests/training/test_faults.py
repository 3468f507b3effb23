"""Training survives kills, damaged files, full disks, folders without permission and clocks that jump."""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import torch

from kine2go_warp.cli.main import main
from kine2go_warp.errors import PolicyError
from kine2go_warp.interruption import TrainingInterrupted
from kine2go_warp.learning.checkpoint import load_checkpoint, write_checkpoint
from kine2go_warp.learning.policy import PolicyFolder, PolicyRecord
from kine2go_warp.learning.presets import FAST, ROBUST
from kine2go_warp.training.beginning import ResumePoint, resume_point
from kine2go_warp.training.train import TrainingTask, train
from tests.conftest import REPOSITORY
from tests.dataset.helpers import small_disk
from tests.killing import KillableWorker, spread_moments
from tests.training.helpers import StopAfter, assert_same_training

TINY = FAST.override({"env.num_worlds": 16, "ppo.iterations": 4, "ppo.save_interval": 1})
"""A checkpoint after each iteration."""


@pytest.fixture(scope="module")
def undisturbed(clip, tmp_path_factory):
    folder = tmp_path_factory.mktemp("undisturbed") / "policy"
    train([clip], TINY, folder, "cpu", processes=1)
    return folder


@pytest.fixture(scope="module")
def stopped_once(clip, tmp_path_factory):
    """A training stopped after three iterations; each has a checkpoint, and the last two are kept."""
    folder = tmp_path_factory.mktemp("stopped") / "policy"
    with pytest.raises(TrainingInterrupted):
        train([clip], TINY, folder, "cpu", processes=1, should_stop=StopAfter(3))
    assert [path.name for path in PolicyFolder(folder).checkpoints()] == ["model_1.pt", "model_2.pt"]
    return folder


@pytest.fixture
def stopped(stopped_once, tmp_path):
    """A copy of that training, to spoil."""
    return PolicyFolder(Path(shutil.copytree(stopped_once, tmp_path / "policy")))


def flip_a_bit(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 16
    path.write_bytes(content)


def cut_short(path):
    path.write_bytes(path.read_bytes()[:-1000])


def empty(path):
    path.write_bytes(b"")


@pytest.mark.parametrize("spoil", [flip_a_bit, cut_short, empty])
def test_a_damaged_checkpoint_is_set_aside_for_the_one_before(stopped, spoil):
    notes = []
    spoil(stopped.checkpoint(2))
    start = resume_point(stopped, 4, notes.append)
    assert start is not None
    assert (start.path, start.iterations) == (stopped.checkpoint(1), 2)
    assert (stopped.path / "model_2.pt.damaged").is_file()
    assert len(notes) == 1
    assert "model_2.pt: not a checkpoint that can be read" in notes[0]
    assert notes[0].endswith("set aside, continuing from the one before")
    spoil(stopped.checkpoint(1))
    assert resume_point(stopped, 4, notes.append) is None
    assert notes[1].endswith("set aside, starting anew")


def test_training_after_damage_ends_with_the_same_bits(clip, stopped, undisturbed):
    notes, seen = [], []
    flip_a_bit(stopped.checkpoint(2))

    def resume():
        train([clip], TINY, stopped.path, "cpu", processes=1, on_progress=seen.append, on_note=notes.append)
        assert_same_training(stopped.path, undisturbed)

    resume()
    assert [state.iteration for state in seen] == [3, 4]
    # Damaged after its end, when no other checkpoint is left, it is made anew.
    flip_a_bit(stopped.checkpoint(3))
    resume()
    assert [state.iteration for state in seen[2:]] == [1, 2, 3, 4]
    assert len(notes) == 2


def test_a_checkpoint_without_the_state_of_training_is_not_continued(stopped):
    notes, path = [], stopped.checkpoint(2)
    weights = load_checkpoint(path, "cpu")
    del weights["training"]
    write_checkpoint(path, weights)
    start = resume_point(stopped, 3, notes.append)
    assert start is not None
    assert start.iterations == 3, "nothing is left to do"
    assert resume_point(stopped, 4, notes.append).path == stopped.checkpoint(1)
    assert "holds no state of the training" in notes[0]


def test_strict_training_does_not_take_over_the_phases_of_several_processes(clip, tmp_path):
    start = ResumePoint(tmp_path / "model_0.pt", {"iter": 0, "training": {"phases": {"visits": torch.zeros(2, 20)}}})
    task = TrainingTask(PolicyFolder(tmp_path), [clip], "cpu", None, True, None, None)
    with pytest.raises(PolicyError, match="begun by 2 processes"):
        task.run(PolicyRecord(ROBUST, (), "", 0, 0.0), start)


def kill_at_random_moments(clip, folder: Path, kills: int) -> None:
    """Kill trainings, spread over their whole life, and run each again."""
    clip.save(folder / "clip.npz")
    killed = resumed = 0
    with KillableWorker("tests.training.train_process", folder / "clip.npz", folder / "reference") as trainer:
        status, life = trainer.ask(folder / "again")
        assert status == 0
        assert_same_training(folder / "again", folder / "reference")
        for number, moment in enumerate(spread_moments(kills)):
            policy = PolicyFolder(folder / str(number))
            status, _ = trainer.ask(policy.path, kill_after=life * moment)
            killed += status != 0
            resumed += bool(status) and bool(policy.checkpoints())
            assert trainer.ask(policy.path)[0] == 0
            assert policy.read_record().complete
            assert_same_training(policy.path, folder / "reference")
            assert not list(policy.path.glob(".tmp-*"))
            assert not list(policy.path.glob("*.damaged")), "a kill damages no checkpoint"
    print(f"{killed} of {kills} killed within {life:.1f} s, {resumed} of them with a checkpoint")
    assert killed > kills // 2


def test_training_that_is_killed_ends_with_the_same_bits(clip, tmp_path):
    kill_at_random_moments(clip, tmp_path, 1)


@pytest.mark.faults
def test_training_that_is_killed_at_any_of_twenty_moments_ends_with_the_same_bits(clip, tmp_path):
    kill_at_random_moments(clip, tmp_path, 20)


@pytest.fixture
def long_training(clip, tmp_path):
    """A command in a process group of its own that trains in two processes, and has written a checkpoint."""
    clip.save(tmp_path / "clip.npz")
    command = ["train", "clip.npz", "--out", "policy", "--device", "cpu", "--num-worlds", "16", "--processes", "2"]
    script = f"import sys; from kine2go_warp.cli.main import main; sys.exit(main({[*command, '--iterations', '5000']}))"
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY)}
    parent = subprocess.Popen(
        [sys.executable, "-c", script], cwd=tmp_path, env=environment, start_new_session=True, stderr=subprocess.PIPE
    )
    deadline = time.monotonic() + 300.0
    while not PolicyFolder(tmp_path / "policy").checkpoints() and time.monotonic() < deadline:
        time.sleep(0.2)
    children = Path(f"/proc/{parent.pid}/task/{parent.pid}/children").read_text().split()
    assert children
    yield parent
    parent.kill()
    parent.wait()
    deadline = time.monotonic() + 60.0
    while any(is_running(child) for child in children):
        assert time.monotonic() < deadline, "no process outlives its parent"
        time.sleep(0.5)


@pytest.mark.faults
def test_no_process_outlives_a_training_that_is_killed(long_training):
    long_training.kill()
    assert long_training.wait() == -signal.SIGKILL


@pytest.mark.faults
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_to_the_whole_group_stops_with_a_checkpoint(long_training, tmp_path, number):
    """As a terminal or ``timeout`` sends it: the processes that simulate must not die before their worlds are saved."""
    os.killpg(long_training.pid, number)
    errors = long_training.communicate(timeout=120.0)[1].decode()
    assert long_training.returncode == 130, errors
    assert "stopping after this iteration" in errors
    assert "Traceback" not in errors
    policy = PolicyFolder(tmp_path / "policy")
    record = policy.read_record()
    assert record.iterations == policy.iterations_done() > 0
    assert resume_point(policy, 5000, pytest.fail).iterations == record.iterations


def is_running(process: str) -> bool:
    """Whether a process exists and is not a zombie that nobody has waited for."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def train_command(clip, tmp_path: Path, folder: Path) -> list[str]:
    """The command that trains ``TINY``."""
    clip.save(tmp_path / "clip.npz")
    settings = [
        "--num-worlds",
        "16",
        "--iterations",
        "4",
        "--ppo.save-interval",
        "1",
        "--processes",
        "1",
        "--device",
        "cpu",
    ]
    return ["train", str(tmp_path / "clip.npz"), "--out", str(folder), *settings]


def test_a_full_disk_is_said_in_one_line_and_the_same_command_completes_later(clip, tmp_path, capfd, undisturbed):
    with small_disk(tmp_path / "disk", 16) as disk:
        folder = disk.folder / "policy"
        command = train_command(clip, tmp_path, folder)
        disk.leave(3 * 1024 * 1024)
        assert main(command) == 2
        assert "no space left on the disk; free some and run the same command again" in capfd.readouterr().err
        disk.free()
        assert main(command) == 0
        assert_same_training(folder, undisturbed)


def test_a_folder_that_may_only_be_read_is_said_in_one_line(clip, stopped, capfd, tmp_path, undisturbed):
    with small_disk(tmp_path / "disk", 16) as disk:
        folder = Path(shutil.copytree(stopped.path, disk.folder / "policy"))
        command = train_command(clip, tmp_path, folder)
        subprocess.run(["mount", "-o", "remount,ro", str(disk.folder)], check=True)
        assert main(command) == 2
        assert "no permission to write or read here" in capfd.readouterr().err
        subprocess.run(["mount", "-o", "remount,rw", str(disk.folder)], check=True)
        assert main(command) == 0
        assert_same_training(folder, undisturbed)


def test_a_clock_that_jumps_changes_nothing(clip, tmp_path, monkeypatch, undisturbed):
    moments = random.Random(0)
    monkeypatch.setattr(time, "time", lambda: moments.choice([0.0, 1e9, 2e9, -1.0]))
    train([clip], TINY, tmp_path / "policy", "cpu", processes=1)
    assert_same_training(tmp_path / "policy", undisturbed)
