"""How fast PPO trains, and where the time goes."""

import contextlib
import io
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import torch
import warp as wp

from kine2go_warp.bench.environment import random_outputs, used_memory
from kine2go_warp.bench.measurement import BenchReport, Measurement, timed
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.learning.presets import Preset
from kine2go_warp.learning.vec_env import ImitationVecEnv, share_stream
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.training.parallel import ParallelVecEnv
from kine2go_warp.training.runner import ImitationRunner

if TYPE_CHECKING:
    from kine2go_warp.training.logger import TrainingProgress

WARM_UP = 2
"""Iterations that are not counted."""


def bench_training(clip: MotionClip, preset: Preset, device: str, repeats: int, processes: int) -> BenchReport:
    """Run some iterations of PPO.

    Args:
        clip: What to track.
        preset: Settings of environment and learner.
        device: Where to train.
        repeats: Iterations that are measured.
        processes: Processes that share the simulation.
    """
    share_stream(device)
    torch.manual_seed(0)
    before = used_memory(device)
    config, horizon = preset.env, preset.ppo.num_steps_per_env
    if processes > 1:
        env = ParallelVecEnv([clip], config, processes)
    else:
        env = ImitationVecEnv(ImitationEnvironment([clip], config, device))
    seen: list[TrainingProgress] = []
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        runner = ImitationRunner(env, preset.ppo, Path(folder), config.seed)
        runner.train(WARM_UP + repeats, seen.append)
    memory = used_memory(device) - before
    collected = [progress.collect_time for progress in seen[WARM_UP:]]
    learned = [progress.learn_time for progress in seen[WARM_UP:]]
    simulated = [step_time(env, horizon) for _ in range(3)]
    env.close()
    world_steps = config.num_worlds * horizon
    totals = [a + b for a, b in zip(collected, learned, strict=True)]
    environment = min(sorted(simulated)[1], *collected)
    measurements = (
        Measurement("training", "steps/s", tuple(world_steps / total for total in totals), "learning included"),
        Measurement("share of environment", "1", tuple(environment / total for total in totals)),
        Measurement(
            "share of policy",
            "1",
            tuple((a - environment) / total for a, total in zip(collected, totals, strict=True)),
            "inference and storage",
        ),
        Measurement("share of PPO update", "1", tuple(b / total for b, total in zip(learned, totals, strict=True))),
        Measurement("memory", "MB", (memory,), "resident set" if device == "cpu" else "of the device"),
    )
    settings = {"worlds": config.num_worlds, "horizon": horizon, "repeats": repeats, "processes": processes}
    return BenchReport("train", device, settings, measurements)


def step_time(env: ImitationVecEnv | ParallelVecEnv, steps: int) -> float:
    """Return how long the environment alone takes for some steps [s]."""
    environment = env.environment
    actions = wp.to_torch(random_outputs(environment, 1)[0])
    actions = actions.repeat(env.num_envs // len(actions) + 1, 1)[: env.num_envs]

    def run() -> None:
        for _ in range(steps):
            env.step(actions)

    return timed(run, lambda: wp.synchronize_device(environment.device))
