"""Means with intervals."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

CONFIDENCE = 0.95
RESAMPLES = 2000
"""Bootstrap samples of an interval."""
SEED = 1
"""Of the bootstrap."""


@dataclass(frozen=True)
class Estimate:
    """A mean with its 95 % interval. NaN where there is nothing to measure, or too little for an interval."""

    value: float
    low: float
    high: float
    count: int
    """Trajectories (or rollouts) that it was computed from."""


NOTHING = Estimate(np.nan, np.nan, np.nan, 0)


def estimate_mean(motions: Sequence[NDArray[Any]]) -> Estimate:
    """Return the mean of the motions' means, so that each motion counts the same, with a bootstrap interval.

    Trajectories are drawn again within each motion, since they and not the motions are what chance has chosen.

    Args:
        motions: Figures of the trajectories of each motion, shapes [num_trajectories]; NaN is left out.
    """
    samples = [values[~np.isnan(values)] for values in motions]
    samples = [values for values in samples if len(values)]
    if not samples:
        return NOTHING
    value, count = float(np.mean([values.mean() for values in samples])), sum(map(len, samples))
    if min(map(len, samples)) < 2:
        return Estimate(value, np.nan, np.nan, count)
    generator = np.random.default_rng(SEED)
    means = np.mean([resampled_means(values, generator) for values in samples], axis=0)
    low, high = np.quantile(means, [0.5 - 0.5 * CONFIDENCE, 0.5 + 0.5 * CONFIDENCE])
    return Estimate(value, float(low), float(high), count)


def resampled_means(values: NDArray[Any], generator: np.random.Generator) -> NDArray[Any]:
    """Return means of samples drawn with replacement, shape [RESAMPLES]."""
    return values[generator.integers(len(values), size=(RESAMPLES, len(values)))].mean(axis=1)


def estimate_share(motions: Sequence[NDArray[Any]]) -> Estimate:
    """Return the share of rollouts of all motions to which something happened, with Wilson's interval.

    A bootstrap of twenty successes in twenty trials would claim certainty; this one does not.

    Args:
        motions: Ones and zeros of the rollouts of each motion, shapes [num_rollouts].
    """
    from scipy.stats import binomtest

    outcomes = np.concatenate([np.asarray(values, bool) for values in motions])
    if not len(outcomes):
        return NOTHING
    interval = binomtest(int(outcomes.sum()), len(outcomes)).proportion_ci(CONFIDENCE, method="wilson")
    return Estimate(float(outcomes.mean()), float(interval.low), float(interval.high), len(outcomes))
