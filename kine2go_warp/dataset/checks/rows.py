"""Checks of single arrays: finite inside each length and empty outside, unit quaternions, even phases, sane draws."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.checks.block import Block
from kine2go_warp.dataset.checks.records import RowCheck
from kine2go_warp.dataset.checks.statistics import flat, largest, median
from kine2go_warp.dataset.schema import OPTIONAL_ROW_ARRAYS, ROW_ARRAYS, TRAJECTORY_ARRAYS

Array = NDArray[np.float64]
Measure = Callable[[Block], Array | None]


def holes(name: str) -> Measure:
    """Return a measure of how many values of a row are not finite inside its trajectory's length."""

    def measure(block: Block) -> Array:
        values = block.stored[name]
        if values.ndim == 1:
            return (~np.isfinite(values)).astype(float)
        count = (~np.isfinite(flat(values, 2))).sum(axis=-1)
        return np.where(block.beyond, 0, count).astype(float)

    return measure


def leftovers(name: str) -> Measure:
    """Return a measure of how many values of a row beyond its trajectory's length are not NaN."""

    def measure(block: Block) -> Array:
        count = (~np.isnan(flat(block.stored[name], 2))).sum(axis=-1)
        return np.where(block.beyond, count, 0).astype(float)

    return measure


def length_outside(block: Block) -> Array:
    """Return by how many rows a length is below 1 or above the array's rows, shape [num_trajectories]."""
    length = block["length"]
    return np.maximum(np.maximum(1.0 - length, length - block.num_rows), 0.0)


def norm_error(name: str) -> Measure:
    """Return a measure of how far quaternions are from unit length."""
    return lambda block: largest(np.abs(np.linalg.norm(block[name], axis=-1) - 1.0), 2)


def sign_flips(name: str) -> Measure:
    """Return a measure that is 1 where a quaternion points away from the one before, shape [n, num_rows - 1]."""

    def measure(block: Block) -> Array:
        product = np.sum(block[name][:, 1:] * block[name][:, :-1], axis=-1)
        return largest(np.where(product < 0.0, 1.0, 0.0), 2)

    return measure


def phase_outside(block: Block) -> Array:
    """Return by how much a phase is outside its range; 1 itself is outside in a cycle."""
    phase, largest = block["phase"], 1.0 if block.settings.is_once else np.nextafter(1.0, 0.0)
    return np.maximum(-phase, phase - largest)


def cycle_fraction(block: Block) -> Array:
    """Return how far a cycle is from a whole number, or from 0 in a motion played once."""
    return np.abs(block["cycle"] - (0.0 if block.settings.is_once else np.round(block["cycle"])))


def turns(block: Block) -> Array:
    """Return the cycles passed, fractions included, shape [num_trajectories, num_rows]."""
    return block["cycle"] + block["phase"]


def paces(block: Block) -> Array:
    """Return the cycles of the clip's own pace that pass in each row, shape [num_trajectories, num_rows - 1].

    NaN where a motion that is played once has reached its end, and stays there.
    """
    passed, places = np.diff(turns(block), axis=1), turns(block)[:, 1:]
    ended = block.settings.is_once & (places >= 1.0)
    return np.where(ended, np.nan, passed) * block["time_scale"][:, None]


def advance(block: Block) -> Array:
    """Return the cycles that pass in a row at the clip's own pace, shape [1]: the median over all rows."""
    return median(paces(block)[None], 1)


def backward_steps(block: Block) -> Array:
    """Return by how many cycles the reference goes backwards, shape [num_trajectories, num_rows - 1]."""
    return np.maximum(-np.diff(turns(block), axis=1), 0.0)


def uneven_steps(block: Block) -> Array:
    """Return how far a step of the reference is from the usual one [cycles], shape [num_trajectories, num_rows - 1]."""
    return np.abs(paces(block) - advance(block))


def warm_up_rows(block: Block) -> Array | None:
    """Return the control steps before each first row, none where a trajectory begins off its reference, shape [n]."""
    settings = block.settings
    if settings.warm_up is None or settings.control_frequency is None:
        return None
    return np.where(block["recovery"] > 0.0, 0.0, round(settings.warm_up * settings.control_frequency))


def start_error(block: Block) -> Array | None:
    """Return how far the first row is from where the drawn phase leads during the warm-up [cycles], shape [n]."""
    rows = warm_up_rows(block)
    if rows is None:
        return None
    return np.abs(turns(block)[:, 0] - block["start_phase"] - rows * advance(block) / block["time_scale"])


def start_outside(block: Block) -> Array:
    """Return how far a start phase is outside [0, 1]; a motion that is played once may begin before its first frame."""
    phase = block["start_phase"]
    return np.maximum(phase - 1.0, 0.0 if block.settings.is_once else -phase)


def outside(name: str, low: float, high: float) -> Measure:
    """Return a measure of how far a drawn value is outside its range."""
    return lambda block: np.maximum(np.maximum(low - block[name], block[name] - high), 0.0)


def noise_error(block: Block) -> Array | None:
    """Return how far the noise of a trajectory is outside the range of the settings."""
    if block.settings.noise is None:
        return None
    low, high = block.settings.noise
    return np.maximum(np.maximum(low - block["noise"], block["noise"] - high), 0.0)


def diversity_error(name: str) -> Measure:
    """Return a measure of how far a draw is outside the range of the settings of diversity."""

    def measure(block: Block) -> Array | None:
        if name not in block.settings.diversity:
            return None
        low, high = block.settings.diversity[name]
        if name == "reset_scale":
            # Others begin as usual.
            low, high = (np.where(block["recovery"] > 0.0, limit, 1.0) for limit in (low, high))
        return np.maximum(np.maximum(low - block[name], block[name] - high), 0.0)

    return measure


def flag_error(name: str) -> Measure:
    """Return a measure of how far a flag is from 0 and 1."""
    return lambda block: np.minimum(np.abs(block[name]), np.abs(block[name] - 1.0))


DRAWN_RANGES = ("time_scale", "speed_offset", "turn_offset", "noise_time", "reset_scale")
QUATERNIONS = tuple(array.name for array in ROW_ARRAYS if "quaternion" in array.dims)
TURNS = ("phase", "cycle")

CHECKS = (
    *(
        RowCheck(
            "finite", array.name, (array.name,),
            "numbers only inside each trajectory's length", "values that are no finite numbers:",
            holes(array.name), 0.0,
        )
        for array in (*ROW_ARRAYS, *OPTIONAL_ROW_ARRAYS, *TRAJECTORY_ARRAYS)
    ),
    *(
        RowCheck(
            "padding", array.name, (array.name, "length"),
            "nothing but NaN beyond each trajectory's length", "values beyond the trajectory's length:",
            leftovers(array.name), 0.0,
        )
        for array in (*ROW_ARRAYS, *OPTIONAL_ROW_ARRAYS)
    ),
    RowCheck(
        "length", "length", ("length",),
        "at least one row and no more than the arrays have", "outside the arrays' rows",
        length_outside, 0.0, "rows",
    ),
    *(
        RowCheck(
            "unit quaternions", name, (name,),
            "quaternions have unit length", "the length of a quaternion is off", norm_error(name), 1e-5,
        )
        for name in QUATERNIONS
    ),
    *(
        RowCheck(
            "quaternion signs", name, (name,),
            "quaternions never flip their sign from row to row", "the sign flips", sign_flips(name), 0.0,
        )
        for name in QUATERNIONS
    ),
    RowCheck(
        "phase range", "phase", ("phase",),
        "phases are in [0, 1), up to 1 in a motion played once", "outside [0, 1)", phase_outside, 0.0, "cycles",
    ),
    RowCheck(
        "whole cycles", "cycle", ("cycle",),
        "cycles are whole numbers, 0 in a motion played once", "off a whole number", cycle_fraction, 0.0, "cycles",
    ),
    RowCheck(
        "forward phase", "phase", TURNS,
        "cycle + phase never goes backwards", "the reference goes backwards", backward_steps, 0.0, "cycles",
    ),
    RowCheck(
        "even phase", "phase", (*TURNS, "time_scale"),
        "cycle + phase, times time_scale, grows by the same amount in every row of every trajectory, up to the "
        "end of a motion played once",
        "the reference's pace is off", uneven_steps, 2e-5, "cycles",
    ),
    RowCheck(
        "start phase", "start_phase", (*TURNS, "start_phase", "time_scale", "recovery"),
        "the first row is the warm-up's time after start_phase, with recovery at it", "the first row's phase is off",
        start_error, 2e-4, "cycles",
    ),
    RowCheck(
        "draws", "start_phase", ("start_phase",),
        "start_phase in [0, 1), or below 0 in a motion played once, heading in [-pi, pi], noise as in the settings",
        "outside [0, 1]",
        start_outside, 0.0,
    ),
    RowCheck(
        "draws", "heading", ("heading",), "", "outside [-pi, pi]",
        outside("heading", -np.pi, np.pi), 1e-5, "rad",
    ),
    RowCheck("draws", "noise", ("noise",), "", "not the noise of the settings, off", noise_error, 1e-6),
    *(
        RowCheck("draws", name, (name, "recovery"), "", "outside the settings' range", diversity_error(name), 1e-6)
        for name in DRAWN_RANGES
    ),
    *(
        RowCheck("draws", name, (name,), "", "neither 0 nor 1, off", flag_error(name), 0.0)
        for name in ("mirrored", "recovery")
    ),
)  # fmt: skip
"""All of them."""
