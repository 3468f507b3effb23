"""The same environment on a GPU. Run with ``pytest -m gpu`` where there is one."""

from dataclasses import replace

import numpy as np
import pytest
import warp as wp

from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.learning.presets import FAST
from kine2go_warp.robots import GO2
from kine2go_warp.rollouts.config import GatherConfig
from kine2go_warp.rollouts.gather import gather
from kine2go_warp.training.train import train
from tests.conftest import ANYTHING_GOES

pytestmark = [
    pytest.mark.gpu,
    pytest.mark.skipif(not wp.is_cuda_available(), reason="no CUDA device here"),
]


def test_a_short_rollout_agrees_with_the_cpu(clip, small_config):
    states = []
    for device in ("cpu", "cuda:0"):
        environment = ImitationEnvironment([clip], small_config, device)
        for _ in range(10):
            environment.step()
        states.append((environment.robot.joint_q.numpy(), environment.observation.numpy()))
    for on_cpu, on_gpu in zip(*states, strict=True):
        np.testing.assert_allclose(on_gpu, on_cpu, rtol=0.02, atol=0.02)


def test_the_captured_graph_follows_eager_execution(clip, small_config):
    config = replace(small_config, num_worlds=64)
    graph = ImitationEnvironment([clip], config, "cuda:0")
    eager = ImitationEnvironment([clip], config, "cuda:0", use_graph=False)
    for _ in range(5):
        graph.step()
        eager.step()
    np.testing.assert_allclose(graph.observation.numpy(), eager.observation.numpy(), rtol=1e-2, atol=1e-2)


def test_training_and_gathering_use_the_gpu_without_being_told(clip, tmp_path):
    train([clip], FAST.override({"env.num_worlds": 512, "ppo.iterations": 3}), tmp_path / "policy")
    writer = DatasetWriter(tmp_path / "dataset.zarr", GO2)
    loose = GatherConfig(trajectories=16, rows=40, **ANYTHING_GOES)
    result = gather(PolicyFolder(tmp_path / "policy"), writer, loose)
    assert result.accepted > 0
    assert writer.attributes("dog_trot")["device"] == "cuda:0"
