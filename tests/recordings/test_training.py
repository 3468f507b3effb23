"""A training that is drawn while it runs, read back."""

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from kine2go_warp.errors import RecordingError
from kine2go_warp.recordings import live
from kine2go_warp.recordings.live import FileSink, ViewerSink
from kine2go_warp.recordings.training import TrainingRecording
from kine2go_warp.recordings.viewer import WebViewer
from tests.recordings.conftest import Recorded

RERUN = str(Path(sys.executable).with_name("rerun"))
CURVES = {"reward/joint_position": 0.5, "error/root_distance": 0.1, "return/mean": float("nan"), "length/mean": 9.0}


def made_up_rows(rng, num_steps):
    """Two worlds over some steps."""
    shape = (2, num_steps)
    rows = {}
    for prefix in ("", "reference_"):
        orientation = rng.normal(size=(*shape, 4))
        rows[f"{prefix}root_position"] = rng.normal(size=(*shape, 3)).astype(np.float32)
        rows[f"{prefix}root_orientation"] = np.float32(orientation / np.linalg.norm(orientation, axis=-1)[..., None])
        rows[f"{prefix}joint_position"] = rng.normal(size=(*shape, 12)).astype(np.float32)
    rows["foot_contact_force"] = np.zeros((*shape, 4, 3), np.float32)
    return rows


def test_worlds_and_curves_are_read_back_bit_for_bit(rng, tmp_path):
    path = tmp_path / "new" / "training.rrd"
    blocks = [made_up_rows(rng, 6) for _ in range(3)]
    with TrainingRecording("trot", FileSink(path)) as recording:
        for number, rows in enumerate(blocks):
            recording.on_worlds((6 * number + np.arange(6)) / 60.0, rows)
            time.sleep(0.5)
            recording.on_iteration(0.1 * (number + 1), number + 1, CURVES)
    assert recording.problem == ""
    assert [file.name for file in path.parent.iterdir()] == ["training.rrd"]
    verified = subprocess.run([RERUN, "rrd", "verify", str(path)], capture_output=True, text=True, check=False)
    assert verified.returncode == 0, verified.stderr
    recorded = Recorded(path)
    for entity, name in (("robot", "root_position"), ("reference", "reference_root_position")):
        for world in range(2):
            expected = np.concatenate([rows[name][world] for rows in blocks])
            places, moments = [], []
            for chunk in recorded.chunks:
                if chunk.entity_path == f"/worlds/{world}/{entity}/base" and not chunk.is_static:
                    batch = chunk.to_record_batch()
                    places += batch.column("Transform3D:translation").to_pylist()
                    moments += (batch.column("time").to_numpy().astype(np.int64) * 1e-9).tolist()
            order = np.argsort(moments)
            assert np.array_equal(np.array(places, np.float32)[order, 0], expected)
            np.testing.assert_allclose(np.array(moments)[order], np.arange(18) / 60.0, atol=1e-8)
    assert {"/curves/reward", "/curves/error", "/curves/length"} <= recorded.entities
    values = [one for one in recorded.chunks if one.entity_path == "/curves/return" and not one.is_static]
    assert not values, "what is not known is no point"
    assert recorded.fixed("/curves/reward", "SeriesLines:names") == ["joint position"]


def test_an_interrupted_training_leaves_its_recording(rng, tmp_path):
    def train_until_interrupted():
        with TrainingRecording("trot", FileSink(tmp_path / "a.rrd")) as recording:
            recording.on_worlds(np.arange(3) / 60.0, made_up_rows(rng, 3))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_until_interrupted()
    assert "/worlds/1/robot/base" in Recorded(tmp_path / "a.rrd").entities


def test_a_full_disk_ends_the_watching_and_not_the_training(rng, tmp_path, monkeypatch):
    monkeypatch.setattr(live, "LEAST_SPACE", 1e18)
    with TrainingRecording("trot", FileSink(tmp_path / "a.rrd")) as recording:
        for _ in range(4):
            recording.on_worlds(np.arange(3) / 60.0, made_up_rows(rng, 3))
            time.sleep(0.2)
    assert "no space left" in recording.problem


def test_a_viewer_that_goes_away_does_not_hold_up_the_training(rng, monkeypatch):
    monkeypatch.setattr(live, "PATIENCE", 1.0)
    server = WebViewer.start([])
    with TrainingRecording("trot", ViewerSink(server.source)) as recording:
        recording.on_worlds(np.arange(3) / 60.0, made_up_rows(rng, 3))
        time.sleep(0.6)
        server.process.kill()
        server.process.wait()
        started = time.monotonic()
        for number in range(5):
            recording.on_worlds((3 * number + np.arange(3)) / 60.0, made_up_rows(rng, 3))
        assert time.monotonic() - started < 0.5
    assert time.monotonic() - started < 20.0


def test_more_than_can_be_drawn_is_dropped_rather_than_kept(tmp_path):
    recording = TrainingRecording("trot", FileSink(tmp_path / "a.rrd"))
    for number in range(1000):
        recording.on_iteration(number / 10, number, CURVES)
    assert len(recording._seen) == 400


def test_a_folder_in_the_way_is_an_error_before_the_training(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file"), TrainingRecording("trot", FileSink(tmp_path / "file" / "a.rrd")):
        raise AssertionError(os.getpid())


def test_names_of_files_are_checked(tmp_path):
    from kine2go_warp.cli.watching import checked

    (tmp_path / "a.rrd").write_text("")
    with pytest.raises(RecordingError, match=r"exists; choose another name"):
        checked(tmp_path / "a.rrd")
    with pytest.raises(RecordingError, match=r"ends in \.rrd"):
        checked(tmp_path / "a.mp4")
