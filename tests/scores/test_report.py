"""Scores of a whole dataset, and the file that holds them."""

import json
import shutil

import numpy as np
import pytest

from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.summary import summarise_motion
from kine2go_warp.robots import GO2
from kine2go_warp.scores.registry import METRICS
from kine2go_warp.scores.report import MotionMetrics, measure, robot_note, score, write_json


@pytest.fixture
def measured(simulated):
    return measure(simulated, GO2)


def test_scores_agree_with_the_summary_of_the_dataset(measured, simulated_dataset):
    estimates = score([measured]).motions["dog_trot"]
    summary = summarise_motion(open_dataset(simulated_dataset), "dog_trot")
    for name in ("joint_rmse", "root_error", "root_angle", "foot_error"):
        assert estimates[name].value == pytest.approx(getattr(summary, name), rel=1e-5)
    assert (measured.trajectories, measured.rows) == (4, 240)


def test_overall_is_the_mean_of_the_motions(measured):
    twice = {name: 2.0 * values for name, values in measured.metrics.items()}
    twice |= {metric.name: measured.metrics[metric.name] for metric in METRICS if metric.is_share}
    scores = score([measured, MotionMetrics("other", 4, 240, twice)])
    assert scores.overall["power"].value == pytest.approx(1.5 * scores.motions["dog_trot"]["power"].value)
    assert scores.overall["acceptance"].count == 8


def test_the_file_holds_every_figure_with_its_meaning_and_interval(measured, tmp_path):
    write_json(tmp_path / "dataset.zarr", [measured], score([measured]), tmp_path / "scores.json")
    content = json.loads((tmp_path / "scores.json").read_text())
    names = [metric.name for metric in METRICS]
    assert list(content["metrics"]) == list(content["overall"]) == names
    motion = content["motions"]["dog_trot"]
    assert motion["trajectories"] == 4
    for name in names:
        assert motion["scores"][name]["low"] <= motion["scores"][name]["value"] <= motion["scores"][name]["high"]
    assert content["settings"]["emd_most_samples"] >= 1171, (
        "the longest trajectories of the paper but for two are whole"
    )


def test_what_cannot_be_measured_is_null(measured, tmp_path):
    unknown = dict(measured.metrics) | {"foot_slip": np.full(4, np.nan)}
    metrics = MotionMetrics("dog_trot", 4, 240, unknown)
    write_json(tmp_path, [metrics], score([metrics]), tmp_path / "scores.json")
    content = json.loads((tmp_path / "scores.json").read_text())
    assert content["overall"]["foot_slip"] == {"value": None, "low": None, "high": None, "count": 0}


def test_another_robot_model_is_remarked_on(simulated_dataset, tmp_path):
    assert robot_note(open_dataset(simulated_dataset), GO2) == ""
    copy = tmp_path / "dataset.zarr"
    shutil.copytree(simulated_dataset, copy)
    text = (copy / "zarr.json").read_text()
    (copy / "zarr.json").write_text(text.replace(GO2.model_hash, "0" * 64))
    assert "another robot model" in robot_note(open_dataset(copy), GO2)
