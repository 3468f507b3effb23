"""A policy under four conditions: with and without noise on its actions, with and without randomisation and pushes."""

import numpy as np

from kine2go_warp.device import choose_device
from kine2go_warp.evaluation.config import EvalConfig
from kine2go_warp.evaluation.metrics import Result, measure
from kine2go_warp.evaluation.newton import NewtonRollouts
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.learning.vec_env import share_stream
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
    policy: PolicyFolder, config: EvalConfig, device: str | None = None, on_progress: ProgressCallback | None = None
) -> list[Result]:
    """Evaluate a policy on all of its clips, clip by clip, in the order of ``CONDITIONS``.

    Args:
        policy: A trained policy.
        config: Settings.
        device: Where to simulate; by default on CUDA where there is one.
        on_progress: Called now and then.

    Raises:
        PolicyError: the policy cannot be read.
    """
    record = policy.read_record()
    clips = policy.read_clips(record)
    device = choose_device(device)
    share_stream(device)
    rows = [config.rows(record.preset.env.control_rate, clip) for clip in clips]
    total, done = sum(rows) * len(WORLDS), 0
    found: dict[tuple[str, str], Result] = {}
    for world, randomised in WORLDS.items():
        noise = tuple(NOISES.values())
        with NewtonRollouts(policy, record, clips, config, noise, randomised, device) as newton:
            for index, clip in enumerate(clips):

                def stepped(step: int, before: int = done, detail: str = f"{clip.name}, {world}") -> None:
                    if on_progress is not None:
                        on_progress(before + step, total, detail)

                batch = newton.run(index, stepped)
                for number, name in enumerate(NOISES):
                    chosen = np.arange(number * config.worlds, (number + 1) * config.worlds)
                    settings = newton.environment.config
                    condition = condition_name(name, world)
                    found[clip.name, condition] = measure(
                        batch, chosen, clip.name, condition, settings.control_duration, newton.environment.spec
                    )
                done += rows[index]
    return [found[clip.name, condition] for clip in clips for condition in CONDITIONS]
