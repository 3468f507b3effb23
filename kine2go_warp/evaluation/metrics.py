"""Metrics of rollouts, wherever they were simulated: those of ``kine2go dataset score``, and errors by phase."""

import warnings
from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.metrics import joint_rmse, root_error
from kine2go_warp.robots import RobotSpec
from kine2go_warp.rollouts.rollout import RecordedRollouts
from kine2go_warp.scores.plots import quantiles_by_phase
from kine2go_warp.scores.registry import METRICS, Rollouts
from kine2go_warp.scores.statistics import Estimate, estimate_mean, estimate_share

METRIC_NAMES = (
    "joint_rmse",
    "root_error",
    "root_angle",
    "foot_error",
    "action_rate",
    "torque_saturation",
    "power",
    "cost_of_transport",
    "joint_limit",
)
"""Metrics of every rollout, as in ``kine2go dataset score``."""
NEWTON_METRIC_NAMES = (*METRIC_NAMES, "foot_slip", "joint_jerk")
"""Those, and the ones that need what only Newton records."""

METRICS_BY_NAME = {metric.name: metric for metric in METRICS}

THRESHOLDS = {"joint_rmse": 0.08, "root_error": 0.08}
"""Largest mean errors of a good policy [rad, m]."""
MIN_SURVIVAL = 0.95
"""Smallest share of rollouts that a good policy completes."""

MEASURED_AT_ONCE = 64
"""Rollouts in memory while they are measured."""


@dataclass(frozen=True)
class Result:
    """Metrics of the rollouts of one clip under one condition."""

    clip: str
    condition: str
    metrics: dict[str, NDArray[Any]]
    """Metrics of each rollout up to its end, shapes [num_rollouts]."""
    length: NDArray[Any]
    """Rows of each rollout."""
    failure: NDArray[Any]
    """Why each rollout ended early, no text if it did not."""
    initial_phase: NDArray[Any]
    """Initial phase of each rollout, in [0, 1)."""
    joint_error: NDArray[Any]
    """10 %, 50 % and 90 % quantiles of the rows' joint RMSE by phase [rad], shape [3, PHASE_BINS]."""
    root_error: NDArray[Any]
    """The same of the root's distance from its reference [m]."""

    @property
    def survival(self) -> Estimate:
        """Share of rollouts that reached their end, with its interval."""
        return estimate_share([self.failure == ""])

    def estimate(self, name: str) -> Estimate:
        """Return the mean of a metric, with its interval."""
        return estimate_mean([self.metrics[name]])

    @property
    def reasons(self) -> dict[str, int]:
        """Number of rollouts that ended early, by reason."""
        return dict(Counter(str(reason) for reason in self.failure if reason))

    @property
    def meets_thresholds(self) -> bool:
        """Whether the mean errors are small enough and enough rollouts survive."""
        errors = all(self.estimate(name).value <= threshold for name, threshold in THRESHOLDS.items())
        return errors and self.survival.value >= MIN_SURVIVAL


def measure(
    recorded: RecordedRollouts,
    chosen: NDArray[Any],
    clip: str,
    condition: str,
    frame_duration: float,
    spec: RobotSpec,
    names: tuple[str, ...] = NEWTON_METRIC_NAMES,
) -> Result:
    """Measure some of the recorded rollouts.

    Args:
        recorded: The rollouts.
        chosen: Their numbers.
        clip: Name of the clip that they track.
        condition: What they were run under.
        frame_duration: Time between two rows [s].
        spec: The robot.
        names: Metrics to measure.
    """
    parts: dict[str, list[NDArray[Any]]] = {name: [] for name in names}
    phases, joint_errors, root_errors = [], [], []
    for first in range(0, len(chosen), MEASURED_AT_ONCE):
        some = chosen[first : first + MEASURED_AT_ONCE]
        rows = recorded.rows(some)
        rollouts = Rollouts(rows, recorded.length[some], frame_duration, len(some), 0, spec)
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            # Rollouts that end at once have nothing to measure; their metrics are NaN and do not count.
            warnings.simplefilter("ignore")
            for name, values in parts.items():
                values.append(METRICS_BY_NAME[name].compute(rollouts))
        phases.append(rows["phase"])
        joint_errors.append(joint_rmse(rows))
        root_errors.append(root_error(rows))
    phase = np.concatenate(phases)
    return Result(
        clip=clip,
        condition=condition,
        metrics={name: np.concatenate(values) for name, values in parts.items()},
        length=recorded.length[chosen],
        failure=recorded.failure[chosen],
        initial_phase=recorded.initial.phase[chosen],
        joint_error=quantiles_by_phase(phase, np.concatenate(joint_errors)),
        root_error=quantiles_by_phase(phase, np.concatenate(root_errors)),
    )
