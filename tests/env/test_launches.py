"""What a control step asks of the device: nothing that a GPU would have to be waited for, and no more than it did."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import torch
import warp as wp

from kine2go_warp.learning.presets import FAST, PAPER, ROBUST
from kine2go_warp.learning.vec_env import ImitationVecEnv
from tests.conftest import COMMITTED_CLIP, REPOSITORY
from tests.env.launching import eager, watched
from tests.waiting import no_waits

PRESETS = {"fast": FAST, "robust": ROBUST, "paper": PAPER}

HOST = ("numpy", "assign", "list")
"""Methods of arrays that wait for the device."""
SYNCHRONISING = ("synchronize", "synchronize_device", "synchronize_stream", "synchronize_event")


@pytest.mark.parametrize("preset", PRESETS)
def test_thirty_steps_kernel_by_kernel_neither_read_nor_write_nor_wait_for_the_host(clip, monkeypatch, preset):
    environment = eager([clip], replace(PRESETS[preset].env, num_worlds=2, episode_time=0.2))
    outputs = [wp.array(np.float32(np.random.default_rng(0).normal(size=(2, 12)))) for _ in range(3)]

    def forbidden(*_, **__):
        raise AssertionError("the host must not wait for the device")

    before = environment.episodes.reason_count.numpy().copy()
    for name in HOST:
        monkeypatch.setattr(wp.array, name, forbidden)
    for name in SYNCHRONISING:
        monkeypatch.setattr(wp, name, forbidden)
    with watched() as seen:
        for step in range(30):
            wp.copy(environment.action, outputs[step % 3])
            environment.step()
    monkeypatch.undo()
    assert seen.launches > 30 * 200
    assert (environment.episodes.reason_count.numpy() > before).any(), "episodes must begin anew"


LAUNCHES = {"fast": 279, "robust": 306, "paper": 279}
"""Kernels that a control step launches outside of the solver's loops."""
LOOP_LAUNCHES = 10
"""Kernels of one turn of the solver's loop."""
ALLOCATIONS = 104
"""Arrays that MuJoCo Warp allocates in a control step."""


@pytest.mark.parametrize("preset", PRESETS)
def test_launches_and_allocations_of_a_step_do_not_grow_unnoticed(clip, preset):
    environment = eager([clip], replace(PRESETS[preset].env, num_worlds=2))
    with watched() as seen:
        environment.step()
    assert seen.loops >= environment.config.substeps
    assert seen.launches <= LAUNCHES[preset]
    assert seen.loop_launches == LOOP_LAUNCHES * seen.loops
    assert seen.allocations <= ALLOCATIONS
    assert seen.loop_allocations == 0, "CUDA cannot allocate in the body of a conditional node"


def test_a_step_as_rsl_rl_makes_it_reads_nothing_from_the_device(environment):
    env = ImitationVecEnv(environment)
    actions = torch.zeros(env.num_envs, 12)
    env.step(actions)
    with no_waits():
        for _ in range(3):
            env.step(actions)


@pytest.mark.slow
@pytest.mark.parametrize("architecture", [80, 90, 100, 120])
def test_every_module_that_a_step_launches_compiles_for_gpus(tmp_path, architecture):
    command = [sys.executable, "-m", "tests.env.compile_step", COMMITTED_CLIP, tmp_path, str(architecture)]
    result = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr[-3000:]
    compiled = list(tmp_path.rglob(f"*.sm{architecture}.cubin"))
    assert len(compiled) == int(result.stdout.split()[-1]) > 40
