"""Statistics as LeRobot keeps them: of each episode, and of all together."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.statistics import Moments, compute_moments, merge

FIGURES = ("min", "max", "mean", "std")
QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}


@dataclass(frozen=True)
class FeatureStatistics:
    """One feature in figures."""

    rows: int
    moments: Moments
    quantiles: NDArray[np.float64]
    """Those of ``QUANTILES``, shape [5, num_columns]."""

    def figures(self) -> dict[str, list[float] | list[int]]:
        """Return the figures by the names that LeRobot gives them."""
        known = {
            "min": self.moments.minimum,
            "max": self.moments.maximum,
            "mean": self.moments.mean,
            "std": self.moments.std,
            **dict(zip(QUANTILES, self.quantiles, strict=True)),
        }
        return {name: values.tolist() for name, values in known.items()} | {"count": [self.rows]}


@dataclass(frozen=True)
class EpisodeStatistics:
    """All features in figures, of one episode or of several."""

    features: Mapping[str, FeatureStatistics]

    @classmethod
    def from_columns(cls, row: Mapping[str, Any], names: Iterable[str]) -> "EpisodeStatistics":
        """Return what ``as_columns`` made columns of.

        Args:
            row: A row of ``meta/episodes``.
            names: The features.
        """
        features = {}
        for name in names:
            known = {figure: np.asarray(row[f"stats/{name}/{figure}"]) for figure in (*FIGURES, *QUANTILES)}
            rows = int(row[f"stats/{name}/count"][0])
            count = np.full(known["mean"].shape, rows)
            squares = rows * known["std"] ** 2
            moments = Moments(count, known["mean"], squares, known["min"], known["max"])
            features[name] = FeatureStatistics(rows, moments, np.stack([known[figure] for figure in QUANTILES]))
        return cls(features)

    def as_json(self) -> dict[str, Any]:
        """Return the content of ``meta/stats.json``."""
        return {name: one.figures() for name, one in self.features.items()}

    def as_columns(self) -> dict[str, Any]:
        """Return the columns of ``meta/episodes``."""
        return {
            f"stats/{name}/{figure}": values
            for name, one in self.features.items()
            for figure, values in one.figures().items()
        }


def episode_statistics(columns: Mapping[str, NDArray[Any]]) -> EpisodeStatistics:
    """Return the statistics of an episode from its features, each of shape [length, num_columns] or [length]."""
    features = {}
    for name, values in columns.items():
        table = values.reshape(len(values), -1).astype(np.float64)
        quantiles = np.quantile(table, list(QUANTILES.values()), axis=0)
        features[name] = FeatureStatistics(len(table), compute_moments(table), quantiles)
    return EpisodeStatistics(features)


def merged_statistics(a: EpisodeStatistics, b: EpisodeStatistics) -> EpisodeStatistics:
    """Return the statistics of two sets of episodes together.

    All is exact but the quantiles, which are means weighted by rows, as in LeRobot's own statistics.
    """
    if not a.features:
        return b
    return EpisodeStatistics({name: _merged(one, b.features[name]) for name, one in a.features.items()})


def _merged(a: FeatureStatistics, b: FeatureStatistics) -> FeatureStatistics:
    rows = a.rows + b.rows
    quantiles = (a.rows * a.quantiles + b.rows * b.quantiles) / rows
    return FeatureStatistics(rows, merge(a.moments, b.moments), quantiles)
