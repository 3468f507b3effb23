"""Reading ``.npz`` files, and the rate of time stamps."""

import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.keypoints import MINIMUM_FRAMES, RATES
from kine2go_warp.motions.sources.tables import read_bytes

UNEVEN = 0.2
"""Time stamps may be off an even grid by this share of a frame: they are often rounded."""


def read_npz(path: Path) -> dict[str, NDArray[Any]]:
    """Return the arrays of an ``.npz`` by name; none of them holds pickled objects.

    Raises:
        ClipError: the file is missing, is something else, or is damaged.
    """
    content = read_bytes(path)
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as data:
            return {name: data[name] for name in data}
    except Exception as error:  # noqa: BLE001 - damaged archives raise errors of many kinds
        raise ClipError(f"{path}: not an .npz of numbers ({error.__class__.__name__})") from None


def rate_of(time: NDArray[Any], path: Path) -> float:
    """Return the rate of time stamps [Hz].

    Raises:
        ClipError: they are no numbers, or not even.
    """
    if time.ndim != 1 or time.dtype.kind not in "fiu" or len(time) < MINIMUM_FRAMES:
        raise ClipError(f"{path}: its time stamps are no row of at least {MINIMUM_FRAMES} numbers")
    time = time.astype(np.float64)
    if not np.isfinite(time).all() or time[-1] <= time[0]:
        raise ClipError(f"{path}: its time stamps do not rise")
    step = (time[-1] - time[0]) / (len(time) - 1)
    off = np.abs(time - time[0] - step * np.arange(len(time))).max() / step
    if off > UNEVEN:
        raise ClipError(f"{path}: time stamps are off an even grid by {off:.2f} frames; resample the file")
    return checked_rate(1.0 / step, path, " (are the stamps in seconds?)")


def checked_rate(rate: float, path: Path, hint: str = "") -> float:
    """Return a rate that a motion can have [Hz].

    Raises:
        ClipError: it is another.
    """
    if not RATES[0] <= rate <= RATES[1]:
        raise ClipError(f"{path}: a rate of {rate:g} Hz; {RATES[0]:g} to {RATES[1]:g} Hz can be used{hint}")
    return float(rate)
