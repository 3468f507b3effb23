"""The captured graph: the same bits as eager execution, and nothing but one launch a step."""

from dataclasses import replace

import numpy as np
import pytest
import torch
import warp as wp

from kine2go_warp.env.config import PhaseSamplingConfig
from kine2go_warp.env.environment import ImitationEnvironment
from tests.env.helpers import EVERYTHING, assert_same_bits, drive, snapshot


def test_the_captured_graph_equals_eager_execution_bit_for_bit_over_500_steps_with_resets(
    clip, once_clip, small_config
):
    config = replace(
        small_config,
        num_worlds=4,
        episode_time=1.0,
        randomization=EVERYTHING,
        phase_sampling=PhaseSamplingConfig(uniform_share=0.5),
        privileged=True,
    )
    graph = drive(ImitationEnvironment([clip, once_clip], config, "cpu"), 500, 1)
    assert sum(step["done"].sum() for step in graph) >= 8 * config.num_worlds, "there must be resets"
    assert_same_bits(graph, drive(ImitationEnvironment([clip, once_clip], config, "cpu", use_graph=False), 500, 1))


def device_pointers(part):
    """Addresses of all arrays that an object holds, structs included."""
    found = {}
    for name, value in vars(part).items():
        if isinstance(value, wp.array):
            found[name] = value.ptr
    return found


def test_a_step_is_one_graph_launch_without_allocation_or_synchronisation(environment, monkeypatch):
    environment.step()
    parts = (environment, environment.simulation, environment.motors, environment.episodes, environment.randomization)
    before = [device_pointers(part) for part in parts]
    assert sum(len(pointers) for pointers in before) > 20

    def forbidden(*_args, **_settings):
        raise AssertionError("not within a step")

    launches = []
    launch_graph = wp.capture_launch
    monkeypatch.setattr(wp, "capture_launch", lambda graph: launches.append(launch_graph(graph)))
    for name in ("launch", "launch_tiled", "copy", "zeros", "empty", "full", "synchronize", "synchronize_device"):
        monkeypatch.setattr(wp, name, forbidden)
    for name in ("numpy", "assign", "fill_", "zero_"):
        monkeypatch.setattr(wp.array, name, forbidden)
    for allocator in ("default_allocator", "pinned_allocator"):
        if hasattr(environment.device, allocator):
            monkeypatch.setattr(type(getattr(environment.device, allocator)), "alloc", forbidden, raising=False)
    for _ in range(3):
        environment.step()
    monkeypatch.undo()
    assert len(launches) == 3
    assert before == [device_pointers(part) for part in parts]


@pytest.mark.gpu
@pytest.mark.skipif(not wp.is_cuda_available(), reason="no CUDA device here")
def test_a_step_does_not_wait_for_the_gpu(clip, small_config):
    from kine2go_warp.learning.vec_env import ImitationVecEnv, share_stream

    share_stream("cuda:0")
    env = ImitationVecEnv(ImitationEnvironment([clip], small_config, "cuda:0"))
    actions = torch.zeros(env.num_envs, 12, device="cuda:0")
    env.step(actions)
    torch.cuda.set_sync_debug_mode("error")
    try:
        for _ in range(3):
            env.step(actions)
    finally:
        torch.cuda.set_sync_debug_mode("default")


def test_each_world_lives_by_its_own_seed_however_many_there_are(clip, small_config):
    config = replace(small_config, randomization=EVERYTHING)
    many = ImitationEnvironment([clip], config, "cpu")
    few = ImitationEnvironment([clip], replace(config, num_worlds=3), "cpu", first_world=2)
    rng = np.random.default_rng(0)
    for _ in range(20):
        output = np.float32(rng.normal(0.0, 1.0, (config.num_worlds, 12)))
        many.action.assign(output)
        few.action.assign(output[2:5])
        many.step()
        few.step()
    one, other = snapshot(many), snapshot(few)
    for name, values in other.items():
        assert values.tobytes() == one[name][2:5].tobytes(), name
