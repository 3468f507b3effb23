"""One training from nothing, and how well its policy tracks: the unit of an ablation."""

import contextlib
import io
import tempfile
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
import warp as wp
from numpy.typing import NDArray

from kine2go_warp import metrics
from kine2go_warp.dataset.trajectories import padded
from kine2go_warp.env.config import EnvConfig, RandomizationConfig
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.learning.inference import NoisyPolicy
from kine2go_warp.learning.presets import Preset
from kine2go_warp.learning.runner import ImitationRunner, TrainingProgress
from kine2go_warp.learning.vec_env import ImitationVecEnv, share_stream
from kine2go_warp.metrics import tracking_quality
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.robots import GO2
from kine2go_warp.rollouts.config import GatherConfig
from kine2go_warp.rollouts.recorder import RolloutRecorder
from kine2go_warp.rollouts.row_writer import AsyncRowWriter

Rows = dict[str, NDArray]

DURATION = 20.0
"""Length of a rollout that survives [s]."""

ROWS_BETWEEN_LOOKS = 64
"""Rows after which it is looked whether any robot still tracks."""


@dataclass(frozen=True)
class Figures:
    """How some rollouts of a policy track their reference: means over rollouts, each as long as it lasted."""

    survival: float
    """Share of rollouts that last 20 s within the limits of gathering (0.4 m, 0.5 rad, no body on the ground)."""
    reward: float
    """Reward collected in 20 s as a share of the reference's own; nothing is earned after a fall."""
    joint_rmse: float
    """[rad]"""
    root_error: float
    """[m]"""
    action_rate: float
    """Mean change of a joint target from one control step to the next [rad]."""
    torque_saturation: float
    """Share of torques at the motors' limit."""
    power: float
    """Sum over joints of the size of torque times velocity [W]."""


@dataclass(frozen=True)
class CurvePoint:
    """What training reported after an iteration."""

    steps: int
    """Environment steps of all worlds so far."""
    seconds: float
    """Time since training began [s]."""
    reward: float
    """Mean reward of the last 100 episodes, NaN before the first one ends."""
    episode_length: float
    """Mean length of the last 100 episodes [control steps]."""


@dataclass(frozen=True)
class Trial:
    """What came of one training."""

    mean: Figures
    """Of the policy's mean output."""
    noisy: Figures
    """Of outputs with the policy's own noise."""
    seconds: float
    """Time that training took [s]."""
    processor_seconds: float
    """Processor time that it took [s], which other work on the machine hardly changes."""
    curve: tuple[CurvePoint, ...]


def run_trial(
    clip: MotionClip,
    preset: Preset,
    device: str,
    rollouts: int,
    on_progress: Callable[[TrainingProgress], None] | None = None,
) -> Trial:
    """Train a policy in one process and evaluate it.

    Args:
        clip: What to track.
        preset: Settings of environment and learner, the seed included.
        device: Where to train.
        rollouts: Rollouts with and without noise, each.
        on_progress: Called after each iteration.
    """
    share_stream(device)
    torch.manual_seed(preset.env.seed)
    with tempfile.TemporaryDirectory() as folder:
        env = ImitationVecEnv(ImitationEnvironment([clip], preset.env, device))
        with contextlib.redirect_stdout(io.StringIO()):
            runner = ImitationRunner(env, preset.ppo, Path(folder), preset.env.seed)
        curve: list[CurvePoint] = []
        steps = preset.env.num_worlds * preset.ppo.num_steps_per_env
        started, processor_started = time.monotonic(), time.process_time()

        def note(progress: TrainingProgress) -> None:
            seconds = time.monotonic() - started
            curve.append(CurvePoint(progress.iteration * steps, seconds, progress.reward, progress.episode_length))
            if on_progress is not None:
                on_progress(progress)

        runner.train(preset.ppo.iterations, note)
        seconds, processor_seconds = time.monotonic() - started, time.process_time() - processor_started
        checkpoint = Path(folder) / "last.pt"
        runner.save(str(checkpoint))
        mean, noisy = evaluate(clip, preset, checkpoint, device, rollouts)
    return Trial(mean, noisy, seconds, processor_seconds, tuple(curve))


def evaluate(
    clip: MotionClip, preset: Preset, checkpoint: Path, device: str, rollouts: int, seed: int = 1
) -> tuple[Figures, Figures]:
    """Return the figures of a policy's mean output and of its noisy output.

    Phases and headings are drawn evenly, the same for every policy; nothing is randomised.
    """
    settings = evaluation_settings(preset.env, 2 * rollouts, seed)
    env = ImitationVecEnv(ImitationEnvironment([clip], settings, device))
    actor = NoisyPolicy(env, preset, checkpoint, seed)
    noise = torch.zeros(2 * rollouts, 1, device=str(env.device))
    noise[rollouts:] = 1.0
    rows, lengths = roll_out(env, actor, noise)
    found = tuple(
        figures({name: values[part] for name, values in rows.items()}, lengths[part], settings)
        for part in (slice(rollouts), slice(rollouts, None))
    )
    return found[0], found[1]


def evaluation_settings(trained: EnvConfig, num_worlds: int, seed: int) -> EnvConfig:
    """Return the environment to evaluate in: that of gathering, without randomisation."""
    config = GatherConfig(warm_up=0.0, seed=seed, randomization=RandomizationConfig())
    return config.environment(trained, round(DURATION * trained.control_rate), num_worlds)


def roll_out(env: ImitationVecEnv, actor: NoisyPolicy, noise: torch.Tensor) -> tuple[Rows, NDArray]:
    """Return the rows of each world's first episode, NaN after its end, and how many there are of each."""
    environment = env.environment
    num_rows = round(DURATION * environment.config.control_rate)
    reason = wp.to_torch(environment.episodes.reason)
    alive = torch.ones_like(reason, dtype=torch.bool)
    survived = torch.zeros_like(reason)
    observation = env.get_observations()
    with tempfile.TemporaryDirectory() as folder, AsyncRowWriter(Path(folder) / "rows") as spool:
        recorder = RolloutRecorder(environment, spool)
        for row in range(num_rows):
            if row % ROWS_BETWEEN_LOOKS == 0 and not bool(alive.any()):
                break
            mean, output = actor(observation, noise)
            recorder.record_state(mean)
            observation, *_ = env.step(output)
            recorder.record_action()
            alive &= reason == 0
            survived += alive.int()
        recorder.finish()
        spool.close()
        lengths = survived.cpu().numpy()
        worlds = np.arange(len(lengths))
        rows = {name: padded(spool.read(name, worlds), lengths) for name in spool.names}
    return rows, lengths


def figures(rows: Rows, lengths: NDArray, config: EnvConfig) -> Figures:
    """Return the figures of some rollouts."""
    num_rows = round(DURATION * config.control_rate)
    assert config.largest_reward is not None
    best = config.largest_reward * num_rows
    with warnings.catch_warnings():
        # A rollout that fails at once has no rows: its figures are NaN and left out.
        warnings.simplefilter("ignore")
        quality = tracking_quality(rows)
        available = GO2.motor_limits.available(rows["joint_torque"], rows["joint_velocity"])
        return Figures(
            survival=float((lengths == num_rows).mean()),
            reward=float(np.nansum(rows["reward"], axis=(1, 2)).mean() / best),
            joint_rmse=float(np.nanmean(quality["joint_rmse"])),
            root_error=float(np.nanmean(quality["root_error"])),
            action_rate=float(np.nanmean(metrics.mean_change(rows["joint_target"]))),
            torque_saturation=float(np.nanmean(metrics.torque_saturation(rows["joint_torque"], available))),
            power=float(np.nanmean(metrics.mechanical_power(rows["joint_torque"], rows["joint_velocity"]))),
        )
