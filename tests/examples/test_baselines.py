"""The baselines of the benchmark: what they are, and that the benchmark runs them from their files."""

import numpy as np
import onnxruntime
import torch

from examples.baselines import FEATURES, NearestNeighbour, main, training_pairs
from kine2go_warp.benchmark.config import BenchmarkConfig
from kine2go_warp.benchmark.policies import load_policy
from kine2go_warp.benchmark.run import SURVIVAL, benchmark_motion
from kine2go_warp.dataset import open_dataset


def test_the_nearest_neighbour_of_a_row_is_the_row_itself(clean_dataset):
    seen, mean = training_pairs(open_dataset(clean_dataset), held_out=True)
    assert len(seen) == 4 * 150 + 130
    chosen = torch.arange(0, len(seen), 7)
    np.testing.assert_array_equal(NearestNeighbour(seen, mean)(seen[chosen]), mean[chosen])


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


def load_feature_sizes():
    """Sizes of the features in the manifest's order, by the names' meanings."""
    joints = ("joint_position", "joint_velocity", "action")
    return {key: 1 if key == "height" else 12 if any(part in key for part in joints) else 3 for key in FEATURES}
