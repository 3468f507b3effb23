"""How the quality metrics of a motion are distributed, and where the limits cut."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray

from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.schema import REJECTED
from kine2go_warp.errors import DatasetError
from kine2go_warp.metrics import FILTER_METRICS
from kine2go_warp.scores.plots import new_figure, save


@dataclass(frozen=True)
class Distribution:
    """One metric over the rollouts of a motion."""

    name: str
    unit: str
    limit: float
    accepted: NDArray[Any]
    """The metric of each accepted rollout."""
    rejected: NDArray[Any]
    """The metric of each rejected rollout that was kept and had any rows."""

    def quantile(self, share: float) -> float:
        """Return a quantile over the accepted rollouts."""
        return float(np.quantile(self.accepted, share))


def distributions(path: Path, motion: str) -> list[Distribution]:
    """Return the distribution of every metric that has a limit.

    Raises:
        DatasetError: the motion cannot be read, or does not tell its limits.
    """
    data = open_dataset(path).load(motion)
    settings = data.attributes.get("gather_settings")
    if not isinstance(settings, dict) or any(limit.setting not in settings for limit in FILTER_METRICS):
        raise DatasetError(f"{path}/{motion}: does not tell the limits it was filtered by; gather it again")
    group = zarr.open_group(path / motion, mode="r")

    def rejected(name: str) -> NDArray[Any]:
        if REJECTED not in group:
            return np.empty(0)
        values = np.asarray(group[f"{REJECTED}/quality/{name}"][...])  # pyright: ignore[reportIndexIssue, reportArgumentType]
        return values[np.isfinite(values)]

    quality = data.trajectories.groups["quality"]
    return [
        Distribution(limit.name, limit.unit, float(settings[limit.setting]), quality[limit.name], rejected(limit.name))
        for limit in FILTER_METRICS
    ]


def draw_distributions(found: dict[str, list[Distribution]], path: Path) -> None:
    """Draw a panel for each metric: every rollout of every motion as a share of the limit, and the limit."""
    rng = np.random.default_rng(0)
    columns = 3
    lines = math.ceil(len(FILTER_METRICS) / columns)
    figure = new_figure(11.0, lines * (0.5 * len(found) + 0.9))
    panels = figure.subplots(lines, columns, squeeze=False).ravel()
    for place, (panel, *each) in enumerate(zip(panels, *found.values(), strict=False)):
        for row, one in enumerate(each):
            for values, colour, label in ((one.accepted, "#0072b2", "accepted"), (one.rejected, "#d55e00", "rejected")):
                scatter = row + rng.uniform(-0.25, 0.25, len(values))
                panel.plot(values, scatter, ".", color=colour, alpha=0.5, markersize=5, label="" if row else label)
        panel.axvline(each[0].limit, color="black", linewidth=1.0)
        panel.set_title(f"{each[0].name.replace('_', ' ')} [{each[0].unit}]", fontsize=10)
        panel.set_yticks(range(len(found)), [""] * len(found) if place % columns else list(found), fontsize=8)
        panel.set_ylim(-0.6, len(found) - 0.4)
        panel.set_xlim(left=0.0)
    for panel in panels[len(FILTER_METRICS) :]:
        panel.set_axis_off()
    figure.axes[0].legend(fontsize=8, loc="upper right")
    save(figure, path)
