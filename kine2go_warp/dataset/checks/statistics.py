"""Reductions that pass over NaN without warnings."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def flat(values: Array, keep: int) -> Array:
    """Return an array with all dimensions after the first ``keep`` joined into one."""
    return values.reshape(*values.shape[:keep], -1)


def largest(values: Array, keep: int) -> Array:
    """Return the largest number along all dimensions after the first ``keep``, NaN where there is none."""
    joined = flat(values, keep)
    if joined.shape[-1] == 0:
        return np.full(joined.shape[:-1], np.nan)
    highest = np.where(np.isnan(joined), -np.inf, joined).max(axis=-1)
    return np.where(np.isneginf(highest), np.nan, highest)


def mean(values: Array, keep: int) -> Array:
    """Return the mean along all dimensions after the first ``keep``, NaN where there is no number."""
    joined = flat(values, keep)
    there = ~np.isnan(joined)
    count = there.sum(axis=-1)
    return np.divide(
        np.where(there, joined, 0.0).sum(axis=-1), count, out=np.full(count.shape, np.nan), where=count > 0
    )


def root_mean_square(values: Array, keep: int) -> Array:
    """Return the root mean square along all dimensions after the first ``keep``, NaN where there is no number."""
    return np.sqrt(mean(values**2, keep))


def median(values: Array, keep: int) -> Array:
    """Return the median along all dimensions after the first ``keep``, NaN where there is no number."""
    joined = flat(values, keep)
    result = np.full(joined.shape[:-1], np.nan)
    there = ~np.isnan(joined).all(axis=-1)
    if there.any():
        result[there] = np.nanmedian(joined[there], axis=-1)
    return result
