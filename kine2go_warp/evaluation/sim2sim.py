"""The exported policy in plain MuJoCo beside the policy in Newton, from the same initial states."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.deployment.controller import ExportedPolicy
from kine2go_warp.device import choose_device
from kine2go_warp.errors import PolicyError
from kine2go_warp.evaluation.config import EvalConfig
from kine2go_warp.evaluation.metrics import METRIC_NAMES, Result, measure
from kine2go_warp.evaluation.mujoco import MujocoRollouts
from kine2go_warp.evaluation.newton import NewtonRollouts
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.learning.vec_env import share_stream
from kine2go_warp.rollouts.config import ProgressCallback
from kine2go_warp.rollouts.rollout import RecordedRollouts

HORIZONS = (0.5, 1.0, 5.0, 20.0)
"""Times at which the distance between the two simulations is reported [s]."""


@dataclass(frozen=True)
class Comparison:
    """Both simulations on one clip."""

    newton: Result
    mujoco: Result
    unknown_ends: tuple[str, ...]
    """Terminations of the training that plain MuJoCo does not know."""
    apart: dict[float, float]
    """Median over the rollouts of the distance between the two roots [m], by the time since the beginning [s]."""


def sim2sim(
    policy: PolicyFolder,
    exported: ExportedPolicy,
    config: EvalConfig,
    device: str | None = None,
    on_progress: ProgressCallback | None = None,
) -> list[Comparison]:
    """Compare a policy's deterministic rollouts, clip by clip.

    Args:
        policy: The policy.
        exported: The same policy, exported.
        config: Settings.
        device: Where Newton simulates; by default on CUDA where there is one.
        on_progress: Called now and then.

    Raises:
        PolicyError: the export is not of the policy's newest checkpoint, or cannot be simulated.
    """
    record = policy.read_record()
    if exported.metadata.checkpoint_sha256 != policy.checkpoint_hash():
        raise PolicyError(
            f"{policy.path}: the export is of another checkpoint; run 'kine2go policy export {policy.path} --overwrite'"
        )
    trained, clips = record.preset.env, exported.clips
    mujoco = MujocoRollouts(exported, trained, config)
    device = choose_device(device)
    share_stream(device)
    rows = [config.rows(trained.control_rate, clip) for clip in clips]
    total, everyone, found = sum(rows) + len(clips) * config.worlds, np.arange(config.worlds), []
    with NewtonRollouts(policy, record, clips, config, (0.0,), False, device) as newton:
        for index, clip in enumerate(clips):
            before = sum(rows[:index]) + index * config.worlds

            def report(done: int, engine: str, before: int = before, name: str = clip.name) -> None:
                if on_progress is not None:
                    on_progress(before + done, total, f"{name}, {engine}")

            one = newton.run(index, lambda step, report=report: report(step, "Newton"))
            other = mujoco.run(
                index, one.initial, lambda done, report=report, index=index: report(rows[index] + done, "MuJoCo")
            )
            time = trained.control_duration
            found.append(
                Comparison(
                    newton=measure(one, everyone, clip.name, "Newton", time, mujoco.spec, METRIC_NAMES),
                    mujoco=measure(other, everyone, clip.name, "MuJoCo", time, mujoco.spec, METRIC_NAMES),
                    unknown_ends=mujoco.unknown_ends,
                    apart=apart(one, other, everyone, trained.control_rate),
                )
            )
    return found


def apart(
    one: RecordedRollouts, other: RecordedRollouts, chosen: NDArray[Any], control_rate: float
) -> dict[float, float]:
    """Return how far the roots of the same rollouts are apart after some times [m], the median of those that last."""
    distance = np.linalg.norm(one.read("root_position", chosen) - other.read("root_position", chosen), axis=-1)
    found = {}
    for horizon in HORIZONS:
        row = round(horizon * control_rate) - 1
        if row < distance.shape[1] and not np.isnan(distance[:, row]).all():
            found[horizon] = float(np.nanmedian(distance[:, row]))
    return found
