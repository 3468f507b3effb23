"""Results of an evaluation as JSON."""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kine2go_warp import __version__
from kine2go_warp.evaluation.config import EvalConfig
from kine2go_warp.evaluation.metrics import METRICS_BY_NAME, MIN_SURVIVAL, NEWTON_METRIC_NAMES, THRESHOLDS, Result
from kine2go_warp.files import atomic_file
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.revision import revision
from kine2go_warp.scores.statistics import Estimate
from kine2go_warp.settings import to_dictionary

if TYPE_CHECKING:
    from kine2go_warp.evaluation.sim2sim import Comparison

FORMAT_VERSION = 2


def write_evaluation(
    policy: PolicyFolder, config: EvalConfig, results: Sequence[Result], device: str, path: Path
) -> None:
    """Write settings and results of an evaluation, whole or not at all."""
    env = policy.read_record().preset.env
    values = {
        **header(policy, config, device),
        "randomised_environment": to_dictionary(config.environment(env, True, config.worlds)),
        "thresholds": {**THRESHOLDS, "survival": MIN_SURVIVAL},
        "results": [described(one, env.control_rate) for one in results],
    }
    write(values, path)


def write_comparison(
    policy: PolicyFolder, config: EvalConfig, found: "Sequence[Comparison]", device: str, path: Path
) -> None:
    """Write settings and results of a comparison of simulators, whole or not at all."""
    env = policy.read_record().preset.env
    clips = [
        {
            "clip": one.newton.clip,
            "roots_apart": {f"{time:g} s": finite(distance) for time, distance in one.apart.items()},
            "results": [described(result, env.control_rate) for result in (one.newton, one.mujoco)],
        }
        for one in found
    ]
    write({**header(policy, config, device), "clips": clips}, path)


def header(policy: PolicyFolder, config: EvalConfig, device: str) -> dict[str, Any]:
    """Return what was evaluated, how, and with what software."""
    return {
        "format_version": FORMAT_VERSION,
        "software_version": __version__,
        "revision": revision(),
        "policy": policy.path.resolve().name,
        "checkpoint_sha256": policy.checkpoint_hash(),
        "device": device,
        "settings": to_dictionary(config),
        "units": {name: METRICS_BY_NAME[name].unit for name in NEWTON_METRIC_NAMES},
    }


def write(values: dict[str, Any], path: Path) -> None:
    """Write JSON values."""
    with atomic_file(path) as temporary:
        temporary.write_text(json.dumps(values, indent=1, allow_nan=False) + "\n")


def described(result: Result, control_rate: float) -> dict[str, Any]:
    """Return a result as JSON values."""
    metrics = {name: estimate_values(result.estimate(name)) for name in result.metrics}
    return {
        "clip": result.clip,
        "condition": result.condition,
        "meets_thresholds": result.meets_thresholds,
        "survival": estimate_values(result.survival),
        "ended_early": result.reasons,
        **metrics,
        "rollouts": {
            "initial_phase": [round(float(value), 6) for value in result.initial_phase],
            "seconds": [round(int(rows) / control_rate, 4) for rows in result.length],
            **{name: [finite(float(value)) for value in values] for name, values in result.metrics.items()},
        },
    }


def estimate_values(estimate: Estimate) -> dict[str, float | int | None]:
    """Return a mean and its interval as JSON values."""
    return {name: finite(value) for name, value in asdict(estimate).items()}


def finite(value: float) -> float | None:
    """Return a number with seven digits, nothing for NaN, which JSON does not know."""
    if isinstance(value, int):
        return value
    return float(f"{value:.7g}") if math.isfinite(value) else None
