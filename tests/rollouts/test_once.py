"""A motion that is played once, from a training of a moment to an export."""

import json
import shutil

import numpy as np
import pytest
import zarr

from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.checks.run import check_dataset
from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.exports.export import export_dataset
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.learning.presets import FAST
from kine2go_warp.robots import GO2
from kine2go_warp.rollouts.config import GatherConfig
from kine2go_warp.rollouts.diversity import DiversitySettings
from kine2go_warp.rollouts.gather import gather, settings_for
from kine2go_warp.rollouts.replay import replay_motion
from kine2go_warp.scores.coverage import measure_coverage
from kine2go_warp.training.train import train
from tests.conftest import ANYTHING_GOES

NAME = "start_and_stop"


@pytest.fixture(scope="module")
def policy(once_clip, tmp_path_factory):
    folder = tmp_path_factory.mktemp("policy") / NAME
    train([once_clip], FAST.override({"env.num_worlds": 16, "ppo.iterations": 3}), folder, "cpu")
    return PolicyFolder(folder)


@pytest.fixture(scope="module")
def dataset(policy, tmp_path_factory):
    """Eight rollouts at several paces, some of them recoveries and some mirrored; offsets are asked for in vain."""
    path = tmp_path_factory.mktemp("dataset") / "dataset.zarr"
    diversity = DiversitySettings(
        time_scale=(0.9, 1.1), mirrored=0.5, recovery=0.3, reset_scale=(1.0, 2.0), turn_offset=(0.1, 0.2)
    )
    config = GatherConfig(trajectories=8, num_worlds=16, max_attempts=16.0, diversity=diversity, **ANYTHING_GOES)
    gather(policy, DatasetWriter(path, GO2), config, "cpu")
    return path


@pytest.fixture(scope="module")
def data(dataset):
    return open_dataset(dataset).load(NAME)


def test_the_rows_are_those_of_the_motion_at_the_slowest_pace_unless_a_number_is_given(once_clip, clip):
    slow = GatherConfig(diversity=DiversitySettings(time_scale=(0.8, 1.25)))
    assert settings_for(GatherConfig(), once_clip, 60.0).rows == once_clip.num_frames
    assert settings_for(slow, once_clip, 60.0).rows == np.ceil(1.25 * (once_clip.num_frames - 1)) + 1
    assert settings_for(GatherConfig(rows=300), once_clip, 60.0).rows == 300
    assert settings_for(slow, clip, 60.0).rows == 571
    bent = GatherConfig(diversity=DiversitySettings(speed_offset=(0.1, 0.1)))
    assert settings_for(bent, once_clip, 60.0).diversity.speed_offset == (0.0, 0.0)


def test_rollouts_go_from_the_first_frame_to_the_last_and_stay_there(data, once_clip):
    assert data.attributes["kind"] == "once"
    rows, draws = data.trajectories.rows, data.trajectories.draws
    recovery = draws["recovery"] > 0
    assert 0 < recovery.sum() < len(recovery)
    assert not rows["cycle"].any()
    assert not draws["turn_offset"].any()
    span = (once_clip.num_frames - 1) * draws["time_scale"]
    begin = np.where(recovery, draws["start_phase"], 0.0)
    expected = np.clip(begin[:, None] + np.arange(rows["phase"].shape[1]) / span[:, None], 0.0, 1.0)
    for index, length in enumerate(draws["length"]):
        np.testing.assert_allclose(rows["phase"][index, :length], expected[index, :length], atol=1e-5)
    whole = draws["length"] == rows["phase"].shape[1]
    assert whole.any()
    assert np.all(rows["phase"][whole, -1] == 1.0)
    ended = rows["phase"] >= 1.0
    last = np.nonzero(ended & np.isfinite(rows["phase"]))
    assert not rows["reference_joint_velocity"][last].any()
    pose = np.where(draws["mirrored"][last[0], None] > 0, np.nan, once_clip.joint_position[-1])
    difference = rows["reference_joint_position"][last] - pose
    assert np.nanmax(np.abs(difference)) < 1e-6


def test_the_check_finds_nothing_and_finds_a_phase_that_wraps(dataset, tmp_path):
    report = check_dataset(dataset, GO2, physics=True)
    assert report.findings == (), report.findings[:3]
    wrapped = shutil.copytree(dataset, tmp_path / "wrapped.zarr")
    phase = zarr.open_group(wrapped)[f"{NAME}/phase"]
    phase[...] = phase[...] % 1.0
    assert {found.check for found in check_dataset(wrapped, GO2).findings} >= {"forward phase"}


def test_its_rollouts_are_replayed_bit_for_bit(dataset):
    results = replay_motion(dataset, NAME, [0, 5], "newton", "cpu")
    assert all(result.is_identical for result in results), results


def test_its_coverage_is_measured_up_to_the_end(data):
    coverage = measure_coverage(data)
    assert 0.0 < coverage.variance_share < 1.0
    assert coverage.across > 0.0
    assert np.isnan(coverage.within), "there is one pass in each trajectory"


def test_it_is_exported(dataset, tmp_path, data):
    export_dataset(dataset, "lerobot", tmp_path / "out")
    info = json.loads((tmp_path / "out" / "meta" / "info.json").read_text())
    assert info["total_frames"] == data.trajectories.draws["length"].sum()
