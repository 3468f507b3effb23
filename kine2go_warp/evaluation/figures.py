"""What is measured of rollouts, wherever they were simulated: the figures of ``kine2go score``, and errors by phase."""

import warnings
from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.evaluation.newton import Batch
from kine2go_warp.kernels.terminations import REASON_NAMES
from kine2go_warp.metrics import joint_rmse, root_error
from kine2go_warp.robots import RobotSpec
from kine2go_warp.scores.plots import quantiles_by_phase
from kine2go_warp.scores.registry import METRICS, Rollouts
from kine2go_warp.scores.statistics import Estimate, estimate_mean, estimate_share

FIGURES = (
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
"""Names of the figures that are measured of every rollout, as in ``kine2go score``."""
NEWTON_FIGURES = (*FIGURES, "foot_slip", "joint_jerk")
"""Also those that need what only Newton records."""

METRICS_BY_NAME = {metric.name: metric for metric in METRICS}

TARGETS = {"joint_rmse": 0.08, "root_error": 0.08}
"""What a good policy stays below [rad, m]."""
TARGET_SURVIVAL = 0.95
"""Share of rollouts that a good policy brings to their end."""

MEASURED_AT_ONCE = 64
"""Rollouts in memory while they are measured."""


@dataclass(frozen=True)
class Result:
    """What rollouts of one clip under one condition have come to."""

    clip: str
    condition: str
    figures: dict[str, NDArray]
    """Figures of each rollout up to its end, shapes [num_rollouts]."""
    length: NDArray
    """Rows of each rollout."""
    failure: NDArray
    """Number of the reason for which each rollout ended early, 0 if it did not."""
    start_phase: NDArray
    """Where in the cycle each rollout began."""
    joint_error: NDArray
    """10 %, 50 % and 90 % quantiles of the rows' joint RMSE by phase [rad], shape [3, PHASE_BINS]."""
    root_error: NDArray
    """The same of the root's distance from its reference [m]."""

    @property
    def survival(self) -> Estimate:
        """Share of rollouts that reached their end, with its interval."""
        return estimate_share([self.failure == 0])

    def estimate(self, name: str) -> Estimate:
        """Return the mean of a figure, with its interval."""
        return estimate_mean([self.figures[name]])

    @property
    def reasons(self) -> dict[str, int]:
        """Number of rollouts that ended early, by reason."""
        return dict(Counter(REASON_NAMES[reason] for reason in self.failure if reason))

    @property
    def meets_targets(self) -> bool:
        """Whether errors are below their targets and enough rollouts survive."""
        errors = all(self.estimate(name).value <= target for name, target in TARGETS.items())
        return errors and self.survival.value >= TARGET_SURVIVAL


def measure(
    batch: Batch,
    chosen: NDArray,
    clip: str,
    condition: str,
    frame_duration: float,
    spec: RobotSpec,
    names: tuple[str, ...] = NEWTON_FIGURES,
) -> Result:
    """Measure some rollouts of a batch.

    Args:
        batch: The rollouts.
        chosen: Their numbers.
        clip: Name of the clip that they track.
        condition: What they were run under.
        frame_duration: Time between two rows [s].
        spec: The robot.
        names: Figures to measure.
    """
    parts: dict[str, list[NDArray]] = {name: [] for name in names}
    phases, joint_errors, root_errors = [], [], []
    for first in range(0, len(chosen), MEASURED_AT_ONCE):
        some = chosen[first : first + MEASURED_AT_ONCE]
        rows = batch.rows(some)
        rollouts = Rollouts(rows, batch.length[some], frame_duration, len(some), 0, spec)
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            # Rollouts that end at once have nothing to measure; their figures are NaN and do not count.
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
        figures={name: np.concatenate(values) for name, values in parts.items()},
        length=batch.length[chosen],
        failure=batch.failure[chosen],
        start_phase=batch.starts.phase[chosen],
        joint_error=quantiles_by_phase(phase, np.concatenate(joint_errors)),
        root_error=quantiles_by_phase(phase, np.concatenate(root_errors)),
    )
