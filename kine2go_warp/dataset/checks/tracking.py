"""Checks of the reference, the limits of acceptance, the rewards and the quality metrics."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.checks.block import Block
from kine2go_warp.dataset.checks.records import RowCheck
from kine2go_warp.dataset.checks.rows import turns
from kine2go_warp.dataset.checks.statistics import largest, median, root_mean_square
from kine2go_warp.dataset.quality import QUALITY_NEEDS
from kine2go_warp.dataset.schema import QUALITY_ARRAYS
from kine2go_warp.metrics import root_angle, root_error
from kine2go_warp.robots.kinematics import foot_positions
from kine2go_warp.rotations import heading, rotate_by_matrices, to_matrices, turn_planar, wrap_angle

Array = NDArray[np.float64]
Measure = Callable[[Block], Array | None]


def disagreement(block: Block, series: Array) -> Array:
    """Return how each trajectory's series differs from the first one's at the same place of the cycle.

    Args:
        block: Trajectories; their ``cycle`` and ``phase`` say where a row is.
        series: Shape [num_trajectories, num_rows].

    Returns:
        Shape [num_trajectories, num_rows], NaN where the first one has no row at that place.
    """
    places = turns(block)
    there = np.isfinite(places[0]) & np.isfinite(series[0])
    if there.sum() < 2:
        return np.full(places.shape, np.nan)
    first = np.stack([np.interp(row, places[0][there], series[0][there], left=np.nan, right=np.nan) for row in places])
    return series - first


def heading_error(block: Block) -> Array:
    """Return how far a trajectory's ``heading`` is from its reference's, judged by the others [rad], shape [n]."""
    forward = to_matrices(block["reference_root_orientation"])[..., 0]
    is_level = np.hypot(forward[..., 0], forward[..., 1]) > 0.5
    yaw = np.where(is_level, np.arctan2(forward[..., 1], forward[..., 0]), np.nan)
    yaw = np.where(np.isnan(yaw), np.nan, np.unwrap(np.where(np.isnan(yaw), 0.0, yaw), axis=1))
    difference = wrap_angle(disagreement(block, yaw - block["heading"][:, None]))
    typical = median(difference, 1)
    return np.abs(wrap_angle(typical - median(typical[None], 1)))


def path_error(block: Block) -> Array:
    """Return how far the reference's path, turned back by ``heading``, is from the first one's [m], shape [n]."""
    back = turn_planar(block["reference_root_position"], -block["heading"][:, None])
    errors = []
    for axis in range(2):
        difference = disagreement(block, back[..., axis])
        errors.append(root_mean_square(difference - median(difference, 1)[:, None], 1))
    error = np.hypot(*errors)
    return np.abs(error - median(error[None], 1))


def beyond_distance(block: Block) -> Array | None:
    """Return by how much a root is farther from its reference than accepted rollouts are [m]."""
    limit = block.settings.max_distance
    return None if limit is None else np.maximum(root_error(block.rows) - limit, 0.0)


def beyond_angle(block: Block) -> Array | None:
    """Return by how much a root is turned further from its reference than in accepted rollouts [rad]."""
    limit = block.settings.max_angle
    return None if limit is None else np.maximum(root_angle(block.rows) - limit, 0.0)


def beyond_rmse(block: Block) -> Array | None:
    """Return by how much joints track worse than in accepted rollouts [rad], shape [n]."""
    limit = block.settings.max_joint_rmse
    rmse = root_mean_square(block["joint_position"] - block["reference_joint_position"], 1)
    return None if limit is None else np.maximum(rmse - limit, 0.0)


def scales(block: Block) -> Array | None:
    """Return weight / control frequency of each reward term, shape [num_terms]."""
    rewards, frequency = block.settings.rewards, block.settings.control_frequency
    if frequency is None or len(rewards) != block["reward"].shape[-1]:
        return None
    return np.array([term.weight for term in rewards]) / frequency


def reward_outside(block: Block) -> Array | None:
    """Return by how much a reward is below 0 or above its largest value, in its scale, shape [n, num_rows]."""
    scale = scales(block)
    if scale is None:
        return None
    parts = block["reward"] / scale
    highest = np.array([np.inf if term.maximum is None else term.maximum for term in block.settings.rewards])
    return np.maximum(largest(np.maximum(-parts, parts - highest), 2), 0.0)


def joint_reward(block: Block, exponent: float) -> Array:
    """Return exp(-exponent * sum of squared joint position errors), shape [n, num_rows]."""
    error = block["joint_position"] - block["reference_joint_position"]
    return np.exp(-exponent * np.sum(error**2, axis=-1))


def in_heading(orientation: Array, vectors: Array) -> Array:
    """Return vectors of the base frame in the heading's frame, shape [..., n, 3]."""
    return turn_planar(rotate_by_matrices(to_matrices(orientation), vectors), -heading(orientation)[..., None])


def foot_reward(block: Block, exponent: float) -> Array:
    """Return exp(-exponent * sum of squared errors of the feet), each pose in its own heading, shape [n, num_rows]."""
    feet = (
        in_heading(block[f"{whose}root_orientation"], foot_positions(block.spec, block[joints]))
        for whose, joints in (("", "joint_position"), ("reference_", "reference_joint_position"))
    )
    return np.exp(-exponent * np.sum(np.subtract(*feet) ** 2, axis=(-2, -1)))


def pose_reward(block: Block, position_exponent: float, angle_exponent: float) -> Array:
    """Return exp(-position_exponent * distance^2) + exp(-angle_exponent * angle^2), shape [n, num_rows]."""
    return np.exp(-position_exponent * root_error(block.rows) ** 2) + np.exp(
        -angle_exponent * root_angle(block.rows) ** 2
    )


def joint_velocity_reward(block: Block, exponent: float) -> Array:
    """Return exp(-exponent * sum of squared joint velocity errors), shape [n, num_rows]."""
    error = block["joint_velocity"] - block["reference_joint_velocity"]
    return np.exp(-exponent * np.sum(error**2, axis=-1))


def velocity_reward(block: Block, linear_exponent: float, angular_exponent: float) -> Array:
    """Return exp(-linear_exponent * |v error|^2) + exp(-angular_exponent * |w error|^2), shape [n, num_rows]."""
    linear, angular = (
        np.sum((block[f"root_{kind}_velocity"] - block[f"reference_root_{kind}_velocity"]) ** 2, axis=-1)
        for kind in ("linear", "angular")
    )
    return np.exp(-linear_exponent * linear) + np.exp(-angular_exponent * angular)


def reward_error(kernel: str, expected: Callable[..., Array]) -> Measure:
    """Return a measure of how far a reward is from what the state and reference of the next row earn, in its scale."""

    def measure(block: Block) -> Array | None:
        scale = scales(block)
        errors = [
            np.abs(block["reward"][:, :-1, index] / scale[index] - expected(block, **term.params)[:, 1:])
            for index, term in enumerate(block.settings.rewards)
            if scale is not None and term.kernel == f"kine2go_warp.kernels.rewards:{kernel}"
        ]
        return np.max(errors, axis=0) if errors else None

    return measure


def quality_error(name: str) -> Measure:
    """Return a measure of how far a stored quality metric is from the rows' own, in parts of 1 + the metric."""

    def measure(block: Block) -> Array | None:
        expected = block.quality.get(name)
        if expected is None:
            return None
        return np.abs(block[f"quality/{name}"] - expected) / (1.0 + np.abs(expected))

    return measure


JOINTS = ("joint_position", "reference_joint_position")
ROOTS = ("root_position", "root_orientation", "reference_root_position", "reference_root_orientation")
VELOCITIES = tuple(f"{whose}root_{kind}_velocity" for whose in ("", "reference_") for kind in ("linear", "angular"))
REWARDS = (
    ("joint position", "track_joint_position", joint_reward, JOINTS),
    ("foot position", "track_foot_position", foot_reward, (*JOINTS, "root_orientation", "reference_root_orientation")),
    ("root pose", "track_root_pose", pose_reward, ROOTS),
    ("joint velocity", "track_joint_velocity", joint_velocity_reward, ("joint_velocity", "reference_joint_velocity")),
    ("root velocity", "track_root_velocity", velocity_reward, VELOCITIES),
)
"""Reward terms that rows alone determine: name, kernel, what they earn before the weight, arrays."""

CHECKS = (
    RowCheck(
        "reference heading", "reference_root_orientation", ("reference_root_orientation", "heading", "phase", "cycle"),
        "turned back by heading, all trajectories have the same reference orientation",
        "the reference is turned otherwise than heading says: off", heading_error, 0.02, "rad",
    ),
    RowCheck(
        "reference path", "reference_root_position", ("reference_root_position", "heading", "phase", "cycle"),
        "turned back by heading, all trajectories have the same reference path",
        "the reference goes another way than heading says: off", path_error, 0.02, "m",
    ),
    RowCheck(
        "acceptance", "root_position", ("root_position", "reference_root_position"),
        "no trajectory is farther from its reference than the settings accept",
        "farther from the reference than accepted rollouts are", beyond_distance, 1e-3, "m",
    ),
    RowCheck(
        "acceptance", "root_orientation", ("root_orientation", "reference_root_orientation"), "",
        "turned further from the reference than accepted rollouts are", beyond_angle, 1e-3, "rad",
    ),
    RowCheck(
        "acceptance", "joint_position", JOINTS, "",
        "tracks worse than accepted rollouts do", beyond_rmse, 1e-3, "rad",
    ),
    RowCheck(
        "reward range", "reward", ("reward",),
        "rewards are between 0 and their largest value", "outside its range", reward_outside, 1e-4, "of the weight",
    ),
    *(
        RowCheck(
            f"{term} reward", "reward", ("reward", *needs),
            f"the {term} reward of a row is what state and reference of the next row earn",
            f"the {term} term is not what the next row earns: off", reward_error(kernel, expected),
            1e-3, "of the weight",
        )
        for term, kernel, expected, needs in REWARDS
    ),
    *(
        RowCheck(
            "quality", f"quality/{array.name}",
            (f"quality/{array.name}", *QUALITY_NEEDS),
            "quality metrics are those of the rows", "not the metric of the rows: off", quality_error(array.name),
            1e-5,
        )
        for array in QUALITY_ARRAYS
    ),
)  # fmt: skip
"""All of them."""
