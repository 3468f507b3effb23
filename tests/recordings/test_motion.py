import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from kine2go_warp.dataset.reader import MotionData
from kine2go_warp.dataset.schema import ROW_ARRAYS
from kine2go_warp.dataset.trajectories import Trajectories
from kine2go_warp.errors import DatasetError
from kine2go_warp.recordings.motion import PAUSE, joined_track, record_motion
from tests.dataset.test_store import made_up

RERUN = str(Path(sys.executable).with_name("rerun"))


@pytest.fixture
def data(rng):
    return MotionData("made_up", {}, np.arange(20) / 60.0, made_up(rng).padded())


@pytest.fixture
def recording(data, tmp_path):
    record_motion(data, tmp_path / "made_up.rrd")
    return tmp_path / "made_up.rrd"


def test_the_recording_is_whole(recording):
    result = subprocess.run([RERUN, "rrd", "verify", str(recording)], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert [path.name for path in recording.parent.iterdir()] == ["made_up.rrd"]


def test_the_recording_holds_robot_reference_contacts_plots_and_blueprint(recording):
    listing = subprocess.run([RERUN, "rrd", "print", str(recording)], capture_output=True, text=True, check=True).stdout
    for entity in (
        "/robot/go2/visual_geometries/base/base_box_visual",
        "/reference/go2/visual_geometries/FL_foot/FL_foot_sphere_visual",
        "/transforms/robot/root",
        "/transforms/reference/RR_calf_joint",
        "/contacts/FL",
        "/plots/errors/root_m",
        "/plots/joints/RL_thigh_reference",
        "/EyeControls3D",
    ):
        assert entity in listing, entity


def test_trajectories_follow_one_another_without_their_padding(data):
    track = joined_track(data, 2)
    assert len(track.time) == 20 + 15
    assert np.all(np.diff(track.time) > 0.0)
    assert track.starts[1][0] == pytest.approx(19 / 60 + PAUSE)
    assert not any(np.isnan(values).any() for values in track.rows.values())


def test_a_motion_without_trajectories_is_refused(rng):
    none = made_up(rng).selected(np.zeros(3, dtype=bool))
    with pytest.raises(DatasetError, match="no trajectory to record"):
        joined_track(MotionData("empty", {}, np.arange(20) / 60.0, none), 3)


def test_made_up_data_covers_every_array(data):
    assert set(data.trajectories.rows) == {array.name for array in ROW_ARRAYS}
    assert isinstance(data.trajectories, Trajectories)
