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
QUERIES = 200
"""Rows of a trajectory whose nearest neighbours are sought."""


@dataclass(frozen=True)
class Coverage:
    """Spread of the joints' positions; mirrored trajectories are mirrored back first."""

    variance_share: float
    """Share of the variance that is not that of their mean at equal phase."""
    across: float
    """Median distance from a row to the nearest row of another trajectory [rad]."""
    within: float
    """The same to the nearest row of its own, half a cycle away or more [rad]; NaN where there is none."""

    def __str__(self) -> str:
        nearest = f"nearest row of another trajectory {self.across:.4f} rad, of the same one {self.within:.4f} rad"
        return f"{100.0 * self.variance_share:.1f} % of the joints' variance is around the cycle; {nearest}"


def measure_coverage(data: MotionData) -> Coverage:
    """Return the coverage of a motion's trajectories.

    Distances are root mean squares over the joints. ``across`` compares each trajectory with the next one alone, so
    that it has as many rows to choose from as ``within``: where both are alike, one longer rollout would do as well.
    """
    draws, rows = data.trajectories.draws, data.trajectories.rows
    places, signs = mirrored(("joint",), "angle")
    joints = rows["joint_position"].astype(np.float64)
    is_mirrored = draws["mirrored"][:, None, None] > 0
    joints = np.where(is_mirrored, joints[..., list(places)] * signs, joints)
    turns = rows["cycle"].astype(np.float64) + rows["phase"]
    lengths = draws["length"]
    each = [values[:length] for values, length in zip(joints, lengths, strict=True)]
    steps = [np.median(np.diff(one[:length])) for one, length in zip(turns, lengths, strict=True) if length > 1]
    cycle_rows = 1.0 / float(np.median(steps)) if steps else math.nan
    flat, phase = np.concatenate(each), np.concatenate([one[:n] for one, n in zip(turns, lengths, strict=True)])
    across = (
        [distances(one, other) for one, other in zip(each, [*each[1:], each[0]], strict=True)] if len(each) > 1 else []
    )
    within = [distances(one, one, 0.5 * cycle_rows) for one in each]
    return Coverage(variance_share(flat, phase, cycle_rows), typical(across), typical(within))


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


def distances(one: Array, other: Array, apart: float = 0.0) -> Array:
    """Return how far some rows of a trajectory are from the nearest of another [rad], NaN where there is none.

    Args:
        one: Joint positions [rad], shape [num_rows, num_joints].
        other: Those of the other trajectory, or the same.
        apart: Rows that are less than so many apart are left out.
    """
    chosen = np.unique(np.linspace(0, len(one) - 1, QUERIES).astype(int))
    squares = np.sum(one[chosen] ** 2, axis=1)[:, None] + np.sum(other**2, axis=1) - 2.0 * one[chosen] @ other.T
    if apart:
        squares[np.abs(chosen[:, None] - np.arange(len(other))) < apart] = np.inf
    least = np.min(squares, axis=1)
    return np.where(np.isfinite(least), np.sqrt(np.maximum(least, 0.0) / one.shape[1]), np.nan)


def typical(found: list[Any]) -> float:
    """Return the median of all numbers that are not NaN."""
    values = np.concatenate(found) if found else np.empty(0)
    values = values[np.isfinite(values)]
    return float(np.median(values)) if len(values) else math.nan
