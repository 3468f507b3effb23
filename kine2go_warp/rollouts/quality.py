"""How good each rollout is, and which ones are good enough."""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.quality import QUALITY_NEEDS, rollout_quality, settled_quality
from kine2go_warp.dataset.schema import QUALITY_ARRAYS
from kine2go_warp.metrics import FILTER_METRICS, Rows
from kine2go_warp.robots import RobotSpec
from kine2go_warp.rollouts.config import GatherConfig

FILTER_NEEDS = (*QUALITY_NEEDS, "push")
"""Row arrays that the filter looks at."""

BORDERLINE = 0.8
"""A rollout one of whose metrics exceeds this share of its limit is worth a look."""


@dataclass(frozen=True)
class FilterResult:
    """Which of some rollouts pass the filter."""

    reasons: tuple[str, ...]
    """Why each one is rejected, an empty text if it is not."""
    quality: dict[str, NDArray[Any]]
    """Arrays of ``QUALITY_ARRAYS``, each of shape [num_trajectories]."""

    @property
    def accepted(self) -> NDArray[np.bool_]:
        """Which rollouts are good enough."""
        return np.array([not reason for reason in self.reasons], dtype=bool)


def filter_rollouts(
    rows: Rows,
    failures: NDArray[Any],
    config: GatherConfig,
    frame_duration: float,
    spec: RobotSpec,
    recovery: NDArray[np.bool_] | None = None,
) -> FilterResult:
    """Decide which rollouts are good enough, and for which reason the others are rejected.

    The metrics are those of all rows; ``settled_quality`` has those that are judged.

    Args:
        rows: Rows as in the dataset, NaN beyond each trajectory's length.
        failures: Why the simulation ended each rollout early, no text if it did not.
        config: The limits.
        frame_duration: Time between two rows [s].
        spec: The robot.
        recovery: Which rollouts begin off their reference, shape [num_trajectories]; by default none.
    """
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        # A rollout that failed at once has no rows: its metrics are NaN, and its reason is known.
        warnings.simplefilter("ignore")
        quality = rollout_quality(rows, frame_duration, spec)
        diversity = config.diversity.resolved()
        recovery = np.zeros(len(failures), bool) if recovery is None else recovery
        judging = (recovery, diversity.recovery_time or 0.0, diversity.recovery_limit_scale or 1.0)
        settled = settled_quality(rows, quality, frame_duration, spec, *judging)
    shares = {one.name: settled[one.name] / getattr(config, one.setting) for one in FILTER_METRICS}
    quality["worst_limit_ratio"] = np.max(np.stack(list(shares.values())), axis=0)
    reasons = []
    for index, failure in enumerate(failures):
        exceeded = [one.reason for one in FILTER_METRICS if not shares[one.name][index] <= 1.0]
        reasons.append(str(failure) or next(iter(exceeded), ""))
    assert set(quality) == {array.name for array in QUALITY_ARRAYS}
    return FilterResult(tuple(reasons), {name: np.asarray(values, np.float32) for name, values in quality.items()})
