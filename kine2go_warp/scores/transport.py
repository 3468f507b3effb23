"""Earth Mover's Distance between the states of a rollout and those of its reference."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.robots import RobotSpec
from kine2go_warp.robots.kinematics import link_positions
from kine2go_warp.rotations import heading, rotate

Array = NDArray[np.float64]

MOST_SAMPLES = 1200
"""States of a trajectory that are compared at most; of more, so many are taken at equal distances."""


def earth_movers_distance(a: NDArray[Any], b: NDArray[Any]) -> float:
    """Return the least mean distance at which the samples of two sets can be paired off, one to one.

    Exact, since sets of one size need no fractions: some permutation is among the best transport plans.

    Args:
        a: Samples, shape [num_samples, num_dimensions].
        b: As many samples of the other distribution.
    """
    from scipy.optimize import linear_sum_assignment
    from scipy.spatial.distance import cdist

    cost = cdist(a, b)
    return float(cost[linear_sum_assignment(cost)].mean())


def distance_per_trajectory(states: NDArray[Any], reference: NDArray[Any], most: int = MOST_SAMPLES) -> Array:
    """Return the Earth Mover's Distance of each rollout from its own reference, shape [num_trajectories].

    Args:
        states: Shape [num_trajectories, num_rows, num_dimensions], NaN beyond each trajectory's end.
        reference: Same shape.
        most: States taken of each trajectory at most.
    """
    distances = np.full(len(states), np.nan)
    for trajectory, (one, other) in enumerate(zip(states, reference, strict=True)):
        there = np.flatnonzero(np.isfinite(one).all(axis=-1) & np.isfinite(other).all(axis=-1))
        if len(there):
            chosen = there[evenly_spaced(len(there), most)]
            distances[trajectory] = earth_movers_distance(one[chosen], other[chosen])
    return distances


def evenly_spaced(count: int, most: int) -> NDArray[np.int_]:
    """Return ``most`` indices below ``count`` at equal distances, ends included; all of them if they are no more."""
    if count <= most:
        return np.arange(count)
    return np.linspace(0, count - 1, most).round().astype(int)


def joint_states(joint_position: NDArray[Any]) -> Array:
    """Return joint positions so scaled that a distance is the root mean square over the joints [rad]."""
    joint_position = np.asarray(joint_position, np.float64)
    return joint_position / np.sqrt(joint_position.shape[-1])


def body_states(root_position: NDArray[Any], root_orientation: NDArray[Any], links_in_base: NDArray[Any]) -> Array:
    """Return where root and links are, whatever the robot's place and heading in the plane.

    Horizontally a point is seen from the root and along its heading, vertically from the floor. All are metres, and so
    scaled that a distance is the root mean square over the points.

    Args:
        root_position: World frame [m], shape [..., 3].
        root_orientation: Quaternions (w, x, y, z), shape [..., 4].
        links_in_base: Points in the base frame [m], shape [..., num_links, 3].

    Returns:
        Shape [..., 3 * (num_links + 1)].
    """
    half = 0.5 * heading(root_orientation)
    zero = np.zeros_like(half)
    unturned = np.stack([np.cos(half), zero, zero, -np.sin(half)], axis=-1)
    points = rotate(unturned[..., None, :], rotate(np.asarray(root_orientation)[..., None, :], links_in_base))
    points = np.concatenate([np.zeros_like(points[..., :1, :]), points], axis=-2)
    points[..., 2] += np.asarray(root_position, np.float64)[..., None, 2]
    return points.reshape(*points.shape[:-2], -1) / np.sqrt(points.shape[-2])


def joint_distance(rows: Mapping[str, NDArray[Any]]) -> Array:
    """Return the Earth Mover's Distance of joint positions [rad], shape [num_trajectories]."""
    return distance_per_trajectory(joint_states(rows["joint_position"]), joint_states(rows["reference_joint_position"]))


def body_distance(rows: Mapping[str, NDArray[Any]], spec: RobotSpec) -> Array:
    """Return the Earth Mover's Distance of the whole body's points [m], shape [num_trajectories]."""

    def states(prefix: str, one: slice) -> Array:
        joints = rows[f"{prefix}joint_position"][one].astype(np.float64)
        root = (rows[f"{prefix}root_position"][one], rows[f"{prefix}root_orientation"][one])
        return body_states(*root, link_positions(spec, joints))

    # One trajectory at a time, since the states are larger than the rows.
    single = [slice(index, index + 1) for index in range(len(rows["joint_position"]))]
    return np.concatenate([distance_per_trajectory(states("", one), states("reference_", one)) for one in single])
