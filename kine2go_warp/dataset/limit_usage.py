"""How close each trajectory came to being rejected, so that people look at those first that were closest."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.motion import Motion, Trajectory, TrajectoryReference
from kine2go_warp.metrics import FILTER_METRICS, joint_rmse, root_angle, root_error

ROW_LIMITS = FILTER_METRICS[:3]
"""Those whose errors are known row by row, also where a dataset stores no metrics."""

ERROR_ARRAYS = (
    "root_position",
    "reference_root_position",
    "root_orientation",
    "reference_root_orientation",
    "joint_position",
    "reference_joint_position",
)
"""What these errors are computed from."""

STORED = "quality/worst_limit_ratio"
"""The largest share of a limit, as gathering has found it."""


@dataclass(frozen=True)
class LimitUsage:
    """How close a trajectory came to each limit."""

    reference: TrajectoryReference
    metrics: tuple[float, ...]
    """Those of ``FILTER_METRICS``, NaN where they are not known."""
    limits: tuple[float, ...]
    """The limits, NaN where the motion's attributes have none."""
    stored: float = math.nan
    """The largest share that the dataset stores, NaN if it stores none."""

    @property
    def shares(self) -> tuple[float, ...]:
        """Each metric as a share of its limit, NaN where one of them is not known."""
        return tuple(metric / limit for metric, limit in zip(self.metrics, self.limits, strict=True))

    @property
    def worst_limit_ratio(self) -> float:
        """The largest share: 1 at a limit, infinite if no limit is known."""
        if not math.isnan(self.stored):
            return self.stored
        known = [share for share in self.shares if not math.isnan(share)]
        return max(known, default=math.inf)

    def ratio(self, metric: str = "") -> float:
        """Return the share of a metric's limit, by its name, -1 where that is not known; without a name the largest."""
        if not metric:
            return self.worst_limit_ratio
        share = self.shares[[limit.name for limit in FILTER_METRICS].index(metric)]
        return -1.0 if math.isnan(share) else share

    @property
    def worst(self) -> str:
        """The metric that is closest to its limit, an empty text if no limit is known."""
        known = [
            (share, limit.label)
            for share, limit in zip(self.shares, FILTER_METRICS, strict=True)
            if not math.isnan(share)
        ]
        return max(known, default=(0.0, ""))[1]


def filter_limits(attributes: Mapping[str, Any]) -> tuple[float, ...]:
    """Return the limits that a motion was filtered by, NaN where its attributes have none."""
    settings = attributes.get("gather_settings")
    known = settings if isinstance(settings, Mapping) else {}
    values = [known.get(limit.setting) for limit in FILTER_METRICS]
    is_limit = [isinstance(value, int | float) and not isinstance(value, bool) and value > 0 for value in values]
    return tuple(float(value) if good else math.nan for value, good in zip(values, is_limit, strict=True))  # type: ignore


def row_errors(rows: Mapping[str, NDArray[Any]]) -> NDArray[np.float64]:
    """Return the errors of each row of a trajectory, in the order of ``ROW_LIMITS``, shape [num_rows, 3].

    The last is the root mean square over the joints of that row.
    """
    return np.stack([root_error(rows), root_angle(rows), joint_rmse(rows)], axis=-1)


def limit_usage(reference: TrajectoryReference, limits: tuple[float, ...]) -> LimitUsage:
    """Return how close a trajectory came to the limits, by the metrics that the dataset stores.

    Where it lacks those of ``ROW_LIMITS``, they are computed from the rows, which needs a ``Trajectory`` with
    ``ERROR_ARRAYS``.
    """
    values = reference.values
    metrics = [float(values.get(f"quality/{limit.name}", math.nan)) for limit in FILTER_METRICS]
    if isinstance(reference, Trajectory) and any(math.isnan(metric) for metric in metrics[: len(ROW_LIMITS)]):
        distance, angle, joints = row_errors(reference.arrays).T
        metrics[: len(ROW_LIMITS)] = float(distance.max()), float(angle.max()), float(np.sqrt(np.mean(joints**2)))
    return LimitUsage(reference, tuple(metrics), limits, float(values.get(STORED, math.nan)))


def limit_usages(motion: Motion, references: Sequence[TrajectoryReference]) -> Iterator[LimitUsage]:
    """Yield how close trajectories of a motion came to the limits, in their order.

    Rows are read only where the dataset stores no metrics.

    Raises:
        DatasetError: an array cannot be read.
    """
    limits = filter_limits(motion.attributes)
    if all(f"quality/{limit.name}" in motion.trajectory_arrays for limit in ROW_LIMITS):
        yield from (limit_usage(reference, limits) for reference in references)
        return
    for trajectory in motion.read(references, ERROR_ARRAYS):
        one = limit_usage(trajectory, limits)
        slim = TrajectoryReference(trajectory.motion, trajectory.index, trajectory.length, trajectory.values)
        yield replace(one, reference=slim)
