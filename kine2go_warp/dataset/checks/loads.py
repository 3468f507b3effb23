"""Checks of what motors and feet bore: last substeps, means and peaks of a row against one another and the weight."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.checks.block import Block
from kine2go_warp.dataset.checks.dynamics import FLOOR
from kine2go_warp.dataset.checks.kinematics import GRAVITY, SHORTEST_WEIGHING
from kine2go_warp.dataset.checks.records import RowCheck
from kine2go_warp.dataset.checks.statistics import largest, mean
from kine2go_warp.metrics import CONTACT_FORCE, SATURATION

Array = NDArray[np.float64]
Measure = Callable[[Block], Array | None]

UNSURE = 1e-3
"""A force this close to the limit of a contact may count either way [N]: the stored one is rounded."""


def beyond_peak(name: str) -> Measure:
    """Return a measure of how much a last or mean value exceeds the largest of its row, in parts of it."""

    def measure(block: Block) -> Array:
        values, peak = block[name], block[f"{name.removesuffix('_mean')}_peak"]
        size = np.linalg.norm(values, axis=-1) if values.ndim > peak.ndim else np.abs(values)
        return np.maximum(largest((size - peak) / (peak + 1.0), 2), 0.0)

    return measure


def stands(block: Block) -> Array:
    """Return which trajectories are long enough to be weighed and touch the ground with feet alone."""
    rows = (~np.isnan(block["leg_contact"])).sum(axis=-1)
    return (rows >= SHORTEST_WEIGHING) & (mean(block["leg_contact"], 1) == 0.0)


def mean_weight_error(block: Block) -> Array:
    """Return how far the mean force on the feet is from what weight and rise of the base ask for, in weights, [n]."""
    velocity, frequency = block["root_linear_velocity"][..., 2], block.settings.control_frequency or np.nan
    rows = (~np.isnan(velocity)).sum(axis=-1)
    last = np.take_along_axis(velocity, np.maximum(rows - 1, 0)[:, None], axis=1)[:, 0]
    rise = (last - velocity[:, 0]) * frequency / np.maximum(rows - 1, 1)
    weight = (block.spec.mass + block["randomization/base_mass"]) * GRAVITY
    force = mean(block["foot_contact_force_mean"][:, 1:, :, 2].sum(axis=-1), 1)
    return np.where(stands(block), np.abs(force / weight - 1.0 - rise / GRAVITY), np.nan)


def last_force_error(block: Block) -> Array:
    """Return how far last substeps' forces are from the means on average, in parts of it, shape [n]."""
    last, whole = (mean(block[name][..., 2].sum(axis=-1), 1) for name in FORCES)
    return np.where(stands(block), np.abs(last / whole - 1.0), np.nan)


def foot_force_error(block: Block) -> Array | None:
    """Return what last substeps leave unexplained of the mean force on each foot, in parts of its own change, [n]."""
    substeps = block.settings.physics_substeps
    if substeps is None:
        return None
    last, whole = (block[name][..., 2] for name in FORCES)
    end = (substeps + 1) / (2 * substeps)
    left = np.abs(whole[:, 1:] - (1.0 - end) * last[:, :-1] - end * last[:, 1:])
    return mean(left, 1) / (mean(np.abs(np.diff(last, axis=1)), 1) + FLOOR)


def contact_error(block: Block) -> Array:
    """Return in how many feet ``foot_contact`` is not what the force says, shape [n, num_rows]."""
    force, contact = np.linalg.norm(block["foot_contact_force"], axis=-1), block["foot_contact"]
    off = (force > CONTACT_FORCE) != (contact > 0.0)
    return np.sum(off & (np.abs(force - CONTACT_FORCE) > UNSURE) & ~np.isnan(contact), axis=-1).astype(float)


def limit_error(block: Block) -> Array:
    """Return in how many joints usage and time at the limit contradict each other, shape [n, num_rows]."""
    usage, share = block["torque_usage"], block["torque_at_limit"]
    off = ((usage >= SATURATION) != (share > 0.0)) & (np.abs(usage - SATURATION) > 1e-6)
    return np.sum(off & ~np.isnan(usage), axis=-1).astype(float)


def usage_error(block: Block) -> Array:
    """Return by how much the largest torque is more than its usage says, in parts of the largest, [n, num_rows]."""
    most = np.maximum(block.motor_limits.driving, block.motor_limits.braking)
    return np.maximum(largest(block["joint_torque_peak"] / most - block["torque_usage"], 2), 0.0)


FORCES = ("foot_contact_force", "foot_contact_force_mean")

CHECKS = (
    *(
        RowCheck(
            "peaks", name, (name, f"{name.removesuffix('_mean')}_peak"),
            "no torque, power or force, of the last substep or in the mean, exceeds the row's peak", "beyond the peak",
            beyond_peak(name), 1e-3, "of 1 + the peak",
        )
        for name in ("joint_torque", "joint_torque_mean", "joint_power_mean", "foot_contact_force")
    ),
    RowCheck(
        "mean force", "foot_contact_force_mean",
        ("foot_contact_force_mean", "leg_contact", "root_linear_velocity", "randomization/base_mass"),
        f"the floor carries the weight that was drawn, over {SHORTEST_WEIGHING} rows or more on the feet alone",
        "the mean force is off", mean_weight_error, 0.02, "of the weight",
    ),
    RowCheck(
        "mean force", "foot_contact_force", (*FORCES, "leg_contact"), "", "on average not the rows' means: off",
        last_force_error, 0.1, "of them",
    ),
    RowCheck(
        "mean force", "foot_contact_force_mean", FORCES, "", "on a foot not what last substeps say: off",
        foot_force_error, 0.5, "of its own change from row to row",
    ),
    RowCheck(
        "foot contact", "foot_contact", ("foot_contact", "foot_contact_force"),
        f"foot_contact is 1 where a foot's force exceeds {CONTACT_FORCE:g} N", "not what the force says, feet:",
        contact_error, 0.0,
    ),
    RowCheck(
        "torque usage", "torque_at_limit", ("torque_at_limit", "torque_usage"),
        "motors at their limit use all of their torque, and none uses less than its largest torque is worth",
        "not what torque_usage says, joints:", limit_error, 0.0,
    ),
    RowCheck(
        "torque usage", "torque_usage", ("torque_usage", "joint_torque_peak"), "",
        "less than the largest torque is worth", usage_error, 1e-3,
    ),
)  # fmt: skip
"""All of them."""
