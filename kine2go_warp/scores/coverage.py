"""How much of the states around a motion's cycle the trajectories cover, from their rows alone."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.motion import MotionData
from kine2go_warp.quantities import mirrored

Array = NDArray[np.float64]

ROWS_A_HARMONIC = 4
"""The cycle mean has a harmonic for so many rows of a cycle."""
MOST_HARMONICS = 100
PLACES = 64
"""Places of the cycle at which trajectories are compared."""


@dataclass(frozen=True)
class Coverage:
    """Spread of the joints' positions; mirrored trajectories are mirrored back first."""

    variance_share: float
    """Share of the variance that is not that of their mean at equal phase."""
    across: float
    """Median distance to the nearest cycle of another trajectory at equal phase [rad]."""
    within: float
    """The same to the nearest other cycle of its own [rad]; NaN where there is none."""

    def __str__(self) -> str:
        if not math.isfinite(self.variance_share):
            return "not measured, since the phase of no trajectory goes on"
        found = (("another trajectory", self.across), ("the same one", self.within))
        nearest = [f"{whose} {value:.4f} rad" for whose, value in found if math.isfinite(value)]
        share = f"{100.0 * self.variance_share:.1f} % of the joints' variance is around the cycle"
        return f"{share}; the nearest cycle at equal phase: {', '.join(nearest) or 'none'}"


def measure_coverage(data: MotionData) -> Coverage:
    """Return the coverage of a motion's trajectories.

    Distances are root mean squares over the joints. ``across`` compares each trajectory with the next one alone, so
    that it has about as many cycles to choose from as ``within``: where both are alike, one longer rollout would do.
    Trajectories whose phase does not go on are left out, and rows after the end of a motion that is played once.
    """
    draws, rows = data.trajectories.draws, data.trajectories.rows
    places, signs = mirrored(("joint",), "angle")
    joints = rows["joint_position"].astype(np.float64)
    joints = np.where(draws["mirrored"][:, None, None] > 0, joints[..., list(places)] * signs, joints)
    turns = rows["cycle"].astype(np.float64) + rows["phase"]
    each = [(turns[index, :length], joints[index, :length]) for index, length in enumerate(draws["length"])]
    is_once = data.attributes.get("kind") == "once"
    if is_once:
        each = [(places[places < 1.0], values[places < 1.0]) for places, values in each]
    each = [one for one in each if len(one[0]) > 3 and np.diff(one[0]).min() > 0.0]
    if not each:
        return Coverage(math.nan, math.nan, math.nan)
    cycle_rows = 1.0 / float(np.median(np.concatenate([np.diff(one[0]) for one in each])))
    # A motion that is played once ends otherwise than it begins: it is half of a cycle that goes there and back.
    half = 0.5 if is_once else 1.0
    share = variance_share(
        np.concatenate([one[1] for one in each]), half * np.concatenate([one[0] for one in each]), cycle_rows / half
    )
    cycles = [by_cycle(*one) for one in each]
    pairs = zip(cycles, [*cycles[1:], cycles[0]], strict=True) if len(cycles) > 1 else ()
    return Coverage(share, typical([nearest(*pair) for pair in pairs]), typical([nearest(one) for one in cycles]))


def variance_share(joints: Array, phase: Array, cycle_rows: float) -> float:
    """Return which share of the joints' variance a Fourier series in the phase leaves.

    Args:
        joints: Joint positions [rad], shape [num_rows, num_joints].
        phase: Place in the cycle [cycles], shape [num_rows].
        cycle_rows: Rows in one cycle.
    """
    most = max(min(cycle_rows / ROWS_A_HARMONIC, len(joints) / 20.0, MOST_HARMONICS), 1.0)
    angle = 2.0 * np.pi * phase[:, None] * np.arange(1, int(most) + 1)
    basis = np.concatenate([np.ones((len(phase), 1)), np.cos(angle), np.sin(angle)], axis=1)
    mean = basis @ np.linalg.lstsq(basis, joints, rcond=None)[0]
    return float(np.sum((joints - mean) ** 2) / np.sum((joints - joints.mean(axis=0)) ** 2))


def by_cycle(turns: Array, joints: Array) -> Array:
    """Return the joints at ``PLACES`` of each cycle [rad], shape [num_cycles, PLACES, num_joints], NaN beyond the ends.

    Args:
        turns: Cycles passed, shape [num_rows].
        joints: Joint positions [rad], shape [num_rows, num_joints].
    """
    from scipy.interpolate import CubicSpline

    first, last = int(np.floor(turns[0])), int(np.floor(turns[-1]))
    grid = first + np.arange((last - first + 1) * PLACES) / PLACES
    found = CubicSpline(turns, joints, extrapolate=False)(grid)
    return found.reshape(-1, PLACES, joints.shape[1])


def nearest(one: Array, other: Array | None = None) -> Array:
    """Return how far each cycle is from the nearest one of another trajectory, or of its own, at every place [rad].

    Args:
        one: As of ``by_cycle``.
        other: The same of another trajectory; by default the other cycles of the same one.

    Returns:
        Shape [num_cycles, PLACES], NaN where there is none to compare with.
    """
    others = one if other is None else other
    distance = np.sqrt(np.mean((one[:, None] - others) ** 2, axis=-1))
    if other is None:
        distance[np.arange(len(one)), np.arange(len(one))] = np.nan
    least = np.where(np.isnan(distance), np.inf, distance).min(axis=1)
    return np.where(np.isfinite(least), least, np.nan)


def typical(found: list[Any]) -> float:
    """Return the median of all numbers that are not NaN."""
    values = np.concatenate([one.ravel() for one in found]) if found else np.empty(0)
    values = values[np.isfinite(values)]
    return float(np.median(values)) if len(values) else math.nan
