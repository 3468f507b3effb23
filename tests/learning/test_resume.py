"""An interrupted training that is resumed ends with the same bits as one that was not interrupted."""

from dataclasses import replace

import pytest

from kine2go_warp.interruption import TrainingInterrupted
from kine2go_warp.learning.config import TrainConfig
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.learning.presets import PRESETS, ROBUST
from kine2go_warp.learning.train import train
from tests.learning.helpers import StopAfter, assert_same_training

ITERATIONS = 6


@pytest.fixture(autouse=True)
def frequent_pushes(monkeypatch):
    """The preset ``robust`` pushes every few seconds, more rarely than these trainings last."""
    randomization = replace(ROBUST.env.randomization, push_interval=(0.2, 0.6))
    often = replace(ROBUST, env=replace(ROBUST.env, randomization=randomization))
    monkeypatch.setitem(PRESETS, "robust", often)


@pytest.fixture(scope="module")
def undisturbed(clip, tmp_path_factory):
    """Trainings without interruption, each made once."""
    done = {}

    def made(preset, processes):
        if (preset, processes) not in done:
            folder = done[preset, processes] = tmp_path_factory.mktemp(preset) / "policy"
            train([clip], TrainConfig(preset, num_worlds=16, iterations=ITERATIONS), folder, "cpu", processes=processes)
        return done[preset, processes]

    return made


@pytest.mark.parametrize(
    ("preset", "processes"),
    [
        ("fast", (1, 1, 1)),
        ("fast", (1, 1, 2)),
        ("fast", (1, 2, 1)),
        ("robust", (1, 1, 1)),
        ("robust", (2, 2, 2)),
    ],
)
def test_a_resumed_training_gives_the_same_bits(clip, tmp_path, undisturbed, preset, processes):
    """Stopped after one and after three iterations, in so many processes."""
    folder = tmp_path / "policy"
    config = TrainConfig(preset, num_worlds=16, iterations=ITERATIONS)
    for number, stop in zip(processes, (1, 2, 99), strict=True):
        arguments = ([clip], config, folder, "cpu")
        if stop < ITERATIONS:
            with pytest.raises(TrainingInterrupted, match=r"model_\d\.pt holds all of it"):
                train(*arguments, processes=number, should_stop=StopAfter(stop))
        else:
            train(*arguments, processes=number, should_stop=StopAfter(stop))
    assert PolicyFolder(folder).read_record().complete
    assert_same_training(folder, undisturbed(preset, processes[0]))
