"""How close the trajectories of a motion came to the limits that they were filtered by."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kine2go_warp.dataset.limit_usage import filter_limits
from kine2go_warp.dataset.motion import MotionData
from kine2go_warp.metrics import FILTER_METRICS
from kine2go_warp.tables import Cell, Table, make_table, number_text

FAIR, CLOSE = 0.5, 0.8
"""Shares of a limit from which on a metric is fair, and close to the limit."""


@dataclass(frozen=True)
class LimitShare:
    """One metric of a motion against its limit."""

    name: str
    label: str
    unit: str
    median: float
    largest: float
    """Of all trajectories."""
    limit: float

    @property
    def share(self) -> float:
        """The largest value over the limit."""
        return self.largest / self.limit

    @property
    def mark(self) -> str:
        """What that is in a word: good, fair, close, or over."""
        if self.share > 1.0:
            return "over"
        return "close" if self.share >= CLOSE else "fair" if self.share >= FAIR else "good"

    @property
    def text(self) -> str:
        """The share in words."""
        return f"{self.share:.0%} of the limit of {self.label}"


def limit_shares(data: MotionData) -> tuple[LimitShare, ...]:
    """Return the metrics of a motion whose limits are known and which its trajectories store, the closest first."""
    quality = data.trajectories.groups.get("quality", {})
    found = []
    for metric, limit in zip(FILTER_METRICS, filter_limits(data.attributes), strict=True):
        values = np.asarray(quality.get(metric.name, ()), np.float64)
        values = values[np.isfinite(values)]
        if len(values) and not math.isnan(limit):
            largest = float(values.max())
            found.append(LimitShare(metric.name, metric.label, metric.unit, float(np.median(values)), largest, limit))
    return tuple(sorted(found, key=lambda one: -one.share))


def limits_table(shares: Sequence[LimitShare]) -> Table:
    """Return a line for each metric: how close the trajectories came to its limit, and what that means."""
    rows = []
    for one in shares:
        numbers = (Cell(number_text(value), value) for value in (one.median, one.largest, one.limit))
        share = Cell(f"{one.share:.0%}", one.share, bar=one.share)
        rows.append((one.label, *numbers, one.unit, share, Cell(one.mark, one.mark, style=one.mark)))
    headings = ("metric", "median", "largest", "limit", "unit", "largest / limit", "mark")
    return make_table("", headings, rows, ("metric", "unit", "mark"))
