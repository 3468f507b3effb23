"""The baselines of the benchmark: what they are, and that the benchmark runs them from their files."""

import sys

import numpy as np
import onnxruntime
import pytest
import torch

from examples.baselines import FEATURES, NearestNeighbour, main, recorded
from kine2go_warp.benchmark.config import BenchmarkConfig
from kine2go_warp.benchmark.policies import load_policy
from kine2go_warp.benchmark.run import SURVIVAL, benchmark_motion
from kine2go_warp.dataset import open_dataset


def test_the_nearest_neighbour_of_a_row_is_the_row_itself(clean_dataset):
    data = recorded(open_dataset(clean_dataset), held_out=True)
    assert len(data.seen) == len(data.reward) == 4 * 150 + 130
    assert torch.nonzero(data.last).flatten().tolist() == [149, 299, 429, 579, 729]
    chosen = torch.arange(0, len(data.seen), 7)
    neighbour = NearestNeighbour(data.seen, data.mean)
    np.testing.assert_array_equal(neighbour(data.seen[chosen]), data.mean[chosen])


def test_a_dataset_of_held_out_motions_alone_is_refused(clean_dataset, tmp_path, capsys):
    assert main([str(clean_dataset), "--out", str(tmp_path / "out")]) == 2
    assert "all of its motions are held out" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_both_are_written_and_run_by_the_benchmark(clean_dataset, tmp_path, capsys):
    tiny = ["--batches", "30", "--batch-size", "64", "--hidden-layers", "32", "--out", str(tmp_path)]
    assert main([str(clean_dataset), "--held-out", *tiny]) == 0
    assert "next: kine2go dataset benchmark" in capsys.readouterr().out
    config = BenchmarkConfig(trajectories=2, engine="mujoco", max_distance=9.0, max_angle=3.1)
    for name in ("clone", "nearest_neighbour"):
        session = onnxruntime.InferenceSession(str(tmp_path / f"{name}.onnx"))
        (size,) = {part.shape[-1] for part in session.get_inputs()}
        assert size == sum(load_feature_sizes().values())
        policy = load_policy(str(tmp_path / f"{name}.onnx"))
        recorded, _ = benchmark_motion(open_dataset(clean_dataset), "dog_trot", policy, config, "cpu")
        assert recorded.estimates[SURVIVAL].count == 2


def test_offline_rl_becomes_such_a_file_too(clean_dataset, tmp_path):
    pytest.importorskip("d3rlpy", reason="uv run --with d3rlpy pytest tests/examples/test_baselines.py")
    tiny = ["--batches", "40", "--batch-size", "64", "--hidden-layers", "32"]
    assert main([str(clean_dataset), "--held-out", "--offline-rl", *tiny, "--out", str(tmp_path)]) == 0
    data = recorded(open_dataset(clean_dataset), held_out=True)
    session = onnxruntime.InferenceSession(str(tmp_path / "offline_rl.onnx"))
    actions = np.asarray(session.run(None, {session.get_inputs()[0].name: data.seen[:9].numpy()})[0])
    assert actions.shape == (9, 12)
    assert (actions >= data.action.amin(dim=0).numpy()).all()
    assert (actions <= data.action.amax(dim=0).numpy()).all()


def test_offline_rl_without_its_library_says_how_to_get_it(clean_dataset, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "d3rlpy", None)
    assert main([str(clean_dataset), "--held-out", "--offline-rl", "--out", str(tmp_path / "out")]) == 2
    assert "--with d3rlpy" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def load_feature_sizes():
    """Sizes of the features in the manifest's order, by the names' meanings."""
    joints = ("joint_position", "joint_velocity", "action")
    return {key: 1 if key == "height" else 12 if any(part in key for part in joints) else 3 for key in FEATURES}
