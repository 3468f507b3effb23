"""How far a stage is, and how long the rest takes."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from kine2go_warp.pipelines import job
from kine2go_warp.pipelines.job import Job, Monitor, read_progress
from kine2go_warp.pipelines.stages.record import RecordStage
from kine2go_warp.pipelines.workspace import Workspace
from tests.pipelines.helpers import TINY


@pytest.fixture
def clock(monkeypatch):
    now = SimpleNamespace(seconds=100.0)
    monkeypatch.setattr(job.time, "monotonic", lambda: now.seconds)
    return now


def test_the_time_left_is_that_of_the_steps_without_what_came_before(clock, tmp_path):
    """A minute of compilation and 40 steps of an earlier run: 2 s a step from then on."""
    folder = SimpleNamespace(
        progress=lambda motion: tmp_path / f"{motion}.json", stop_file=tmp_path / "stop", log=lambda _: tmp_path / "log"
    )
    monitor = Monitor(SimpleNamespace(workspace=folder, motion="walk"), "train")  # type: ignore[arg-type]
    left = []
    for seconds, done in ((60.0, 41), (2.0, 42), (2.0, 43), (2.0, 44)):
        clock.seconds += seconds
        monitor.advanced(done, 100, "")
        note = read_progress(Path(tmp_path / "walk.json"))
        assert note is not None
        left.append(note.seconds_left)
    assert left == [None, 116.0, 114.0, 112.0]


def test_recordings_are_left_out_where_rerun_is_not_installed(tmp_path, monkeypatch):
    trot = Job("dog_trot", TINY, Workspace(tmp_path), None, "cpu")
    assert RecordStage().enabled(trot)
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    assert not RecordStage().enabled(trot)
