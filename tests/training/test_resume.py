"""An interrupted training that is resumed ends with the same bits as one that was not interrupted."""

import os
import signal

import pytest
import torch
import warp as wp
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from kine2go_warp.cli.main import main
from kine2go_warp.cli.progress import Progress
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.interruption import TrainingInterrupted
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.learning.presets import FAST, ROBUST
from kine2go_warp.learning.vec_env import ImitationVecEnv, share_stream
from kine2go_warp.training.beginning import ResumePoint, resume_point
from kine2go_warp.training.runner import ImitationRunner
from kine2go_warp.training.train import train
from tests.training.helpers import StopAfter, assert_same_training

ITERATIONS = 4


SHORT = {"env.num_worlds": 16, "ppo.iterations": ITERATIONS}
EVERYTHING_CHANGES = {
    "env.randomization.push_interval": (0.2, 0.6),
    "env.initial_limit_scale": 2.0,
    "env.limit_anneal_time": 1.2,
    "ppo.final_std": 0.2,
    "ppo.final_entropy_coef": 0.0,
    "ppo.annealing_iterations": 3,
}
"""Pushes within these short trainings, and limits, noise and entropy that fall."""
TRAININGS = {"fast": FAST.override(SHORT), "robust": ROBUST.override({**SHORT, **EVERYTHING_CHANGES})}


@pytest.fixture(scope="module")
def undisturbed(clip, tmp_path_factory):
    """Trainings without interruption, each made once."""
    done = {}

    def made(preset, processes):
        if (preset, processes) not in done:
            folder = done[preset, processes] = tmp_path_factory.mktemp(preset) / "policy"
            train([clip], TRAININGS[preset], folder, "cpu", processes=processes)
        return done[preset, processes]

    return made


@pytest.mark.parametrize(
    ("preset", "processes", "stops"),
    [
        ("fast", (1, 1), (2,)),
        ("robust", (1, 1), (2,)),
        ("fast", (2, 1), (1,)),
        pytest.param("fast", (1, 2, 1), (1, 2), marks=pytest.mark.slow),
        pytest.param("robust", (2, 2), (2,), marks=pytest.mark.slow),
    ],
)
def test_a_resumed_training_gives_the_same_bits(clip, tmp_path, undisturbed, preset, processes, stops):
    """Stopped after so many iterations each time, in so many processes."""
    folder = tmp_path / "policy"
    arguments = ([clip], TRAININGS[preset], folder, "cpu")
    for number, stop in zip(processes, stops, strict=False):
        with pytest.raises(TrainingInterrupted, match=r"model_\d\.pt holds all of it"):
            train(*arguments, processes=number, should_stop=StopAfter(stop))
    assert not PolicyFolder(folder).read_record().complete
    train(*arguments, processes=processes[-1])
    assert PolicyFolder(folder).read_record().complete
    # Where phases are weighted by failures, the number of processes matters.
    assert_same_training(folder, undisturbed(preset, 1 if preset == "fast" else processes[0]))


ON_GPU = [pytest.mark.gpu, pytest.mark.skipif(not wp.is_cuda_available(), reason="no CUDA device here")]


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=ON_GPU)])
def test_a_restored_training_is_where_the_checkpoint_was_written(clip, tmp_path, device):
    """On a GPU as well. What follows has the same bits on the CPU; a GPU adds in an order that differs each time."""
    config = TRAININGS["robust"].override({"ppo.iterations": 3})
    with pytest.raises(TrainingInterrupted):
        train([clip], config, tmp_path / "stopped", device, processes=1, should_stop=StopAfter(2))
    start = resume_point(PolicyFolder(tmp_path / "stopped"), 3, pytest.fail)
    assert start is not None
    share_stream(device)
    preset, again = config, PolicyFolder(tmp_path / "again")
    env = ImitationVecEnv(ImitationEnvironment([clip], preset.env, device))
    runner = ImitationRunner(env, preset.ppo, again.path, preset.env.seed)
    runner.restore(start.checkpoint)
    assert runner.current_learning_iteration == 2
    runner.current_learning_iteration = 1
    runner.save(str(again.checkpoint(1)))
    assert_same_training(again.path, tmp_path / "stopped")
    assert train([clip], config, tmp_path / "stopped", device, processes=1).complete


def test_phases_learned_by_two_processes_are_continued_by_two(tmp_path):
    """Whatever number is asked for."""
    tables = {"visits": torch.zeros(2, 20)}
    start = ResumePoint(tmp_path / "model_0.pt", {"iter": 0, "training": {"phases": tables}})
    assert start.processes == 2
    assert ResumePoint(start.path, {"iter": 0, "training": {"phases": {}}}).processes is None


def test_more_iterations_go_on_as_if_they_had_been_asked_for_at_once(clip, tmp_path, undisturbed):
    folder = tmp_path / "policy"
    for iterations in (2, ITERATIONS):
        train([clip], FAST.override({**SHORT, "ppo.iterations": iterations}), folder, "cpu", processes=1)
    assert_same_training(folder, undisturbed("fast", 1))


def test_the_log_of_a_resumed_training_holds_each_iteration_once(clip, tmp_path):
    """Also those that were logged after the last checkpoint and then done again."""
    folder = tmp_path / "policy"
    arguments = ([clip], TRAININGS["fast"], folder, "cpu")

    def die_after_three(state):
        if state.iteration == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(*arguments, processes=1, on_progress=die_after_three)
    assert PolicyFolder(folder).iterations_done() == 1
    train(*arguments, processes=1)
    log = EventAccumulator(str(folder)).Reload()
    assert [event.step for event in log.Scalars("Loss/value")] == list(range(ITERATIONS))


def test_the_first_interrupt_stops_with_a_checkpoint_and_the_command_continues(clip, tmp_path, monkeypatch, capfd):
    clip.save(tmp_path / "clip.npz")
    settings = ["--num-worlds", "16", "--iterations", "4", "--device", "cpu", "--processes", "1"]
    command = ["train", str(tmp_path / "clip.npz"), "--out", str(tmp_path / "policy"), *settings]

    def interrupt(_progress, done, _total, _detail):
        if done == 2:
            os.kill(os.getpid(), signal.SIGINT)

    with monkeypatch.context() as patch:
        patch.setattr(Progress, "advanced", interrupt)
        assert main(command) == 130
    assert "stopping after this iteration, with a checkpoint" in capfd.readouterr().err
    assert PolicyFolder(tmp_path / "policy").iterations_done() == 2
    assert main(command) == 0
    assert PolicyFolder(tmp_path / "policy").iterations_done() == 4
