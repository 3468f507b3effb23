"""The base's motion: smoothing, and a height at which legs neither lock nor fold and nothing is below the floor."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, maximum_filter1d, minimum_filter1d

from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.robots import RobotSpec
from kine2go_warp.robots.kinematics import leg_points
from kine2go_warp.rotations import continuous, to_rotation

Array = NDArray[np.float64]

RAMP = 0.08
"""Time over which the base gives way to a limit before and after it [s]."""


def smooth_root(position: Array, orientation: Array, frames: float) -> tuple[Array, Array]:
    """Filter root positions and orientations (w, x, y, z) with a Gaussian of a standard deviation in frames."""
    if frames <= 0.0:
        return position, orientation
    smooth = gaussian_filter1d(continuous(orientation), frames, axis=0, mode="nearest")
    return (
        gaussian_filter1d(position, frames, axis=0, mode="nearest"),
        smooth / np.linalg.norm(smooth, axis=1, keepdims=True),
    )


def leg_length_limits(spec: RobotSpec, margin: float) -> tuple[float, float]:
    """Return least and greatest distance from thigh joint to foot when the knee keeps off its limits [m]."""
    leg = spec.legs[0]
    bends = np.array([spec.joint_lower[2] + margin, spec.joint_upper[2] - margin])
    squares = leg.thigh_length**2 + leg.calf_length**2 + 2.0 * leg.thigh_length * leg.calf_length * np.cos(bends)
    shortest, longest = np.sqrt(squares)
    return float(shortest), float(longest)


def height_bounds(spec: RobotSpec, position: Array, orientation: Array, feet: Array, margin: float) -> Array:
    """Return by how much the base may sink (negative) or rise [m], shape [num_frames, 2], so that legs reach.

    A foot at distance r from its hip joint needs a leg of length sqrt(r^2 - w^2), w being the width of the hip. Where
    a foot is out of reach sideways, no height helps and the bound is the best one.
    """
    shortest, longest = leg_length_limits(spec, margin)
    offsets = np.array([leg.hip_offset for leg in spec.legs])
    width = abs(spec.legs[0].thigh_offset[1])
    hips = position[:, None] + np.einsum("tij,kj->tki", to_rotation(orientation).as_matrix(), offsets)
    above = hips[..., 2] - feet[..., 2]
    aside = np.sum((hips[..., :2] - feet[..., :2]) ** 2, axis=-1)
    highest = np.sqrt(np.maximum(longest**2 + width**2 - aside, 0.0))
    lowest = np.sqrt(np.maximum(shortest**2 + width**2 - aside, 0.0))
    return np.stack([(lowest - above).max(axis=1), (highest - above).min(axis=1)], axis=1)


def ramp_frames(frame_duration: float) -> int:
    """Return over how many frames the base gives way to a limit."""
    return max(round(RAMP / frame_duration), 1)


def smooth_shift(needed: Array, frames: int) -> Array:
    """Return a smooth curve at or beyond what is needed, all of one sign.

    A running extreme over a window, then a mean over the same window: each mean holds only values that include the
    frame's own need, so that smoothing never undoes it.
    """
    extreme = maximum_filter1d if needed.max() > 0.0 else minimum_filter1d
    size = 2 * frames + 1
    kernel = np.hanning(size + 2)[1:-1]
    reached = extreme(needed, size, mode="nearest")
    return np.convolve(np.pad(reached, frames, mode="edge"), kernel / kernel.sum(), mode="valid")


def fit_height(
    spec: RobotSpec, position: Array, orientation: Array, feet: Array, frame_duration: float, config: RetargetConfig
) -> Array:
    """Return root positions raised or lowered, smoothly and as little as needed, so that legs keep off their limits."""
    fitted = position.copy()
    frames = ramp_frames(frame_duration)
    for side in (1, 0):
        bound = height_bounds(spec, fitted, orientation, feet, config.knee_margin)[:, side]
        needed = np.minimum(bound, 0.0) if side == 1 else np.maximum(bound, 0.0)
        if np.any(needed != 0.0):
            fitted[:, 2] += smooth_shift(needed, frames)
    return fitted


def lowest_body_point(spec: RobotSpec, position: Array, orientation: Array, joints: Array) -> Array:
    """Return the height of the lowest point of trunk, head and knees over the floor [m], shape [num_frames]."""
    rotation = to_rotation(orientation).as_matrix()

    def heights(points_b: Array) -> Array:
        return np.einsum("tj,t...j->t...", rotation[:, 2], points_b) + position[:, 2].reshape(
            -1, *[1] * (points_b.ndim - 2)
        )

    half = 0.5 * np.array(spec.trunk_size)
    corners = half * [[x, y, -1.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)]
    knees = heights(leg_points(spec, joints)[:, :, 2]).min(axis=1) - spec.thigh_radius
    trunk = heights(np.broadcast_to(corners, (len(position), 4, 3))).min(axis=1)
    head = heights(np.broadcast_to(spec.head_centre, (len(position), 1, 3)))[:, 0] - spec.head_radius
    return np.minimum(np.minimum(knees, trunk), head)
