"""A policy under four conditions: with and without noise on its actions, with and without randomisation and pushes."""

from collections.abc import Sequence

import numpy as np

from kine2go_warp.device import choose_device
from kine2go_warp.evaluation.config import EvalConfig
from kine2go_warp.evaluation.metrics import Result, measure
from kine2go_warp.evaluation.newton import NewtonRollouts
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.learning.vec_env import share_stream
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.rollouts.config import ProgressCallback

NOISES = {"deterministic": 0.0, "stochastic": 1.0}
"""Noise on the actions, in standard deviations of the policy."""
WORLDS = {"plain": False, "randomised": True}
"""Whether the worlds differ and the robots are pushed."""


def condition_name(noise: str, world: str) -> str:
    """Return the name of a condition."""
    return f"{noise}, {world}"


CONDITIONS = tuple(condition_name(noise, world) for world in WORLDS for noise in NOISES)


def evaluate(
    policy: PolicyFolder,
    config: EvalConfig,
    device: str | None = None,
    on_progress: ProgressCallback | None = None,
    clips: Sequence[MotionClip] = (),
) -> list[Result]:
    """Evaluate a policy clip by clip, in the order of ``CONDITIONS``, under those that the settings ask for.

    Args:
        policy: A trained policy.
        config: Settings.
        device: Where to simulate; by default on CUDA where there is one.
        on_progress: Called now and then.
        clips: Clips to track; by default those that it was trained on.

    Raises:
        PolicyError: the policy cannot be read, or a clip is for another robot.
    """
    record = policy.read_record()
    clips = policy.checked_clips(record, clips) if clips else policy.read_clips(record)
    device = choose_device(device)
    share_stream(device)
    rows = [config.rows(record.preset.env.control_rate, clip) for clip in clips]
    worlds = {name: randomised for name, randomised in WORLDS.items() if config.randomised or not randomised}
    noises = {name: noise for name, noise in NOISES.items() if config.stochastic or not noise}
    total, done = sum(rows) * len(worlds), 0
    found: dict[tuple[str, str], Result] = {}
    for world, randomised in worlds.items():
        noise = tuple(noises.values())
        with NewtonRollouts(policy, record, clips, config, noise, randomised, device) as newton:
            for index, clip in enumerate(clips):

                def stepped(step: int, before: int = done, detail: str = f"{clip.name}, {world}") -> None:
                    if on_progress is not None:
                        on_progress(before + step, total, detail)

                batch = newton.run(index, stepped)
                for number, name in enumerate(noises):
                    chosen = np.arange(number * config.worlds, (number + 1) * config.worlds)
                    settings = newton.environment.config
                    condition = condition_name(name, world)
                    found[clip.name, condition] = measure(
                        batch, chosen, clip.name, condition, settings.control_duration, newton.environment.spec
                    )
                done += rows[index]
    return [one for clip in clips for condition in CONDITIONS if (one := found.get((clip.name, condition))) is not None]
