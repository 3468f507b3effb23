"""Checks of velocities against the change of positions from row to row.

The simulator adds each physics substep's *new* velocity to the position (semi-implicit Euler), so the change over a
row is the mean of its n substep velocities. Were the velocity to change evenly over the row, that mean would be the
velocity at its beginning times (n - 1) / 2n plus the velocity at its end times (n + 1) / 2n. What an impact or a motor
does within a row is left over; it is small against the velocity's own change from row to row, which is the yardstick
here, since both grow with the motion. A shift by one row leaves a remainder about as large as the yardstick.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.checks.block import Block
from kine2go_warp.dataset.checks.records import RowCheck
from kine2go_warp.dataset.checks.statistics import flat, largest, mean, root_mean_square
from kine2go_warp.rotations import rotation_between

Array = NDArray[np.float64]
Measure = Callable[[Block], Array | None]

FLOOR = 0.01
"""Added to the yardstick for robots that stand still [m/s, rad/s]."""

PUSH = "push"
"""Array of velocities [m/s] that pushes add to the base between a row and the next, where a dataset has it."""


def rate_of_change(block: Block, position: str) -> Array:
    """Return the change of a position array from row to row over a second, shape [n, num_rows - 1, ...]."""
    frequency = block.settings.control_frequency or np.nan
    if position.endswith("orientation"):
        return frequency * rotation_between(block[position][:, :-1], block[position][:, 1:])
    return frequency * np.diff(block[position], axis=1)


def remainder(block: Block, position: str, velocity: str) -> Array | None:
    """Return what the velocity leaves unexplained of the position's change, shape [n, num_rows - 1, components].

    Rows in which the base was pushed count for joints alone.
    """
    settings = block.settings
    if settings.control_frequency is None or settings.physics_substeps is None:
        return None
    substeps = settings.physics_substeps
    # The reference is interpolated, not integrated.
    end = 0.5 if position.startswith("reference") else (substeps + 1) / (2 * substeps)
    values = block[velocity]
    expected = (1.0 - end) * values[:, :-1] + end * values[:, 1:]
    left = np.abs(flat(rate_of_change(block, position) - expected, 2))
    if PUSH in block and position.startswith(("root", "link")):
        left[np.any(block[PUSH][:, :-1] != 0.0, axis=-1)] = np.nan
    return left


def overall(position: str, velocity: str) -> Measure:
    """Return a measure of the remainder over whole trajectories, in parts of the velocity's own change, shape [n].

    It is a root mean square, for joints the mean size: impacts stop single joints within a row, and where a joint's
    velocity hardly changes otherwise, the squares of these few rows would decide.
    """
    average = mean if position.endswith("joint_position") else root_mean_square

    def measure(block: Block) -> Array | None:
        left = remainder(block, position, velocity)
        if left is None:
            return None
        return average(left, 1) / (average(np.abs(np.diff(block[velocity], axis=1)), 1) + FLOOR)

    return measure


def row_by_row(position: str, velocity: str) -> Measure:
    """Return a measure of the remainder in each row, in parts of the trajectory's largest change of velocity."""

    def measure(block: Block) -> Array | None:
        left = remainder(block, position, velocity)
        if left is None:
            return None
        yardstick = largest(np.abs(np.diff(block[velocity], axis=1)), 1) + FLOOR
        return largest(left, 2) / yardstick[:, None]

    return measure


PAIRS = (
    ("root_position", "root_linear_velocity"),
    ("root_orientation", "root_angular_velocity"),
    ("joint_position", "joint_velocity"),
    ("link_position", "link_linear_velocity"),
)
"""Positions and their velocities."""

REFERENCE_PAIRS = tuple(tuple(f"reference_{name}" for name in pair) for pair in PAIRS[:3])

CHECKS = tuple(
    check
    for position, velocity in PAIRS
    for check in (
        RowCheck(
            f"{velocity.replace('_', ' ')}, overall", velocity, (position, velocity),
            f"{velocity} is the change of {position}: on average over a trajectory",
            f"does not explain how {position} changes: off", overall(position, velocity),
            0.3, "of its own change from row to row",
        ),
        RowCheck(
            f"{velocity.replace('_', ' ')}, each row", velocity, (position, velocity),
            f"{velocity} is the change of {position}: in each row",
            f"does not explain how {position} changes: off", row_by_row(position, velocity),
            0.8, "of its own largest change",
        ),
    )
) + tuple(
    RowCheck(
        "reference velocity", velocity, (position, velocity),
        "the reference's velocities are the changes of its poses",
        f"does not explain how {position} changes: off", overall(position, velocity),
        0.4, "of its own change from row to row",
    )
    for position, velocity in REFERENCE_PAIRS
)  # fmt: skip
"""All of them."""
