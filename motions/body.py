"""The base's motion: smoothing, and a height at which legs neither lock nor fold and nothing is below the floor."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, maximum_filter1d, minimum_filter1d

from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.motions.poses import Poses
from kine2go_warp.motions.stance import Reach, intervals
from kine2go_warp.robots import RobotSpec
from kine2go_warp.robots.kinematics import leg_angles, leg_points, shank_rotations
from kine2go_warp.rotations import continuous, to_rotation, turn_between

Array = NDArray[np.float64]

RAMP = 0.08
"""Time over which the base gives way to a limit before and after it [s]."""

GRAVITY = 9.81
"""[m/s^2]"""
LEAD = 0.08
"""Time over which the slopes of a flight are led into the stances beside it [s]."""
FLOOR_PASSES = 3
"""How often the base is raised until no part of the body is below the floor."""


def smooth_root(position: Array, orientation: Array, frames: float) -> tuple[Array, Array]:
    """Filter root positions and orientations (w, x, y, z) with a Gaussian of a standard deviation in frames."""
    if frames <= 0.0:
        return position, orientation
    margin = min(math.ceil(4.0 * frames), len(position) - 1)
    ends = [(margin, margin), (0, 0)]

    def smooth(values: Array) -> Array:
        # Mirrored at the ends through the end itself, so that a motion goes on there instead of stopping.
        longer = np.pad(values, ends, mode="reflect", reflect_type="odd")
        return gaussian_filter1d(longer, frames, axis=0, mode="nearest")[margin : margin + len(values)]

    turned = smooth(continuous(orientation))
    return smooth(position), turned / np.linalg.norm(turned, axis=1, keepdims=True)


def leg_length_limits(spec: RobotSpec, margin: float) -> tuple[float, float]:
    """Return least and greatest distance from thigh joint to foot when the knee keeps off its limits [m]."""
    leg = spec.legs[0]
    bends = np.array([spec.joint_lower[2] + margin, spec.joint_upper[2] - margin])
    squares = leg.thigh_length**2 + leg.calf_length**2 + 2.0 * leg.thigh_length * leg.calf_length * np.cos(bends)
    shortest, longest = np.sqrt(squares)
    return float(shortest), float(longest)


def hip_joints(spec: RobotSpec, position: Array, orientation: Array) -> Array:
    """Return the hip joints in the world frame [m], shape [num_frames, 4, 3]."""
    offsets = np.array([leg.hip_offset for leg in spec.legs])
    return position[:, None] + np.einsum("tij,kj->tki", to_rotation(orientation).as_matrix(), offsets)


def leg_reach(spec: RobotSpec, position: Array, orientation: Array, margin: float, give: float = 0.0) -> Reach:
    """Return how far legs reach when knees keep off their limits by a margin [rad]."""
    farthest = math.hypot(leg_length_limits(spec, margin)[1], spec.legs[0].thigh_offset[1])
    return Reach(hip_joints(spec, position, orientation), farthest, spec.foot_radius, give)


def rolled(spec: RobotSpec, poses: Poses) -> Array:
    """Return how far the centres of feet have rolled since the first frame [m], shape [num_frames, 4, 2].

    A sphere that rolls without slipping moves by its radius times the turn of the shank that it is fixed to.
    """
    shanks = shank_rotations(spec, joints_for(spec, poses))
    shanks = to_rotation(poses.root_orientation).as_matrix()[:, None] @ shanks
    turn = turn_between(shanks[:-1], shanks[1:])
    steps = spec.foot_radius * np.stack([turn[..., 1], -turn[..., 0]], axis=-1)
    return np.concatenate([np.zeros((1, 4, 2)), np.cumsum(steps, axis=0)])


def height_bounds(spec: RobotSpec, position: Array, orientation: Array, feet: Array, margin: float) -> Array:
    """Return by how much the base may sink (negative) or rise [m], shape [num_frames, 2], so that legs reach.

    A foot at distance r from its hip joint needs a leg of length sqrt(r^2 - w^2), w being the width of the hip. Where
    a foot is out of reach sideways, no height helps and the bound is the best one.
    """
    shortest, longest = leg_length_limits(spec, margin)
    width = abs(spec.legs[0].thigh_offset[1])
    hips = hip_joints(spec, position, orientation)
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


def fit_height(spec: RobotSpec, poses: Poses, frame_duration: float, config: RetargetConfig) -> Poses:
    """Return poses with the base raised or lowered, smoothly and as little as needed: legs keep off their limits."""
    assert poses.feet is not None
    fitted = poses.root_position.copy()
    frames = ramp_frames(frame_duration)
    for side in (1, 0):
        bound = height_bounds(spec, fitted, poses.root_orientation, poses.feet, config.knee_margin)[:, side]
        needed = np.minimum(bound, 0.0) if side == 1 else np.maximum(bound, 0.0)
        if np.any(needed != 0.0):
            fitted[:, 2] += smooth_shift(needed, frames)
    return replace(poses, root_position=fitted)


def fly(poses: Poses, stance: NDArray[np.bool_], fall: float, frame_duration: float) -> Poses:
    """Return poses whose base follows a parabola while no foot stands; the feet in the air follow it.

    The parabola joins the heights of lift-off and landing. Its slopes there are led into the stances beside it.

    Args:
        poses: With feet.
        stance: Whether each foot stands, shape [num_frames, 4].
        fall: Acceleration of a falling body, downwards [m / frame^2].
        frame_duration: [s]
    """
    assert poses.feet is not None
    height = poses.root_position[:, 2]
    slope, lead = np.gradient(height), max(round(LEAD / frame_duration), 1)
    shift, lifted = np.zeros(len(height)), np.zeros(len(height))
    for flight in intervals(~np.asarray(stance.any(axis=1))):
        first, last = flight.first - 1, flight.last + 1
        if first < lead or last + lead >= len(height):
            continue
        span = last - first
        air = np.arange(1, span)
        parabola = height[first] + (height[last] - height[first]) * air / span + 0.5 * fall * air * (span - air)
        lifted[flight.frames] = parabola - height[flight.frames]
        mean = (height[last] - height[first]) / span
        ramp = np.arange(1, lead) * (1.0 - np.arange(1, lead) / lead) ** 2
        shift[first - lead + 1 : first] -= (mean + 0.5 * fall * span - slope[first]) * ramp[::-1]
        shift[last + 1 : last + lead] += (mean - 0.5 * fall * span - slope[last]) * ramp
    # Where a stance is shorter than the lead, the next flight begins with nothing of the last one.
    shift[~stance.any(axis=1)] = 0.0
    up = np.array([0.0, 0.0, 1.0])
    return replace(
        poses,
        root_position=poses.root_position + np.outer(shift + lifted, up),
        feet=poses.feet + lifted[:, None, None] * up,
    )


def joints_for(spec: RobotSpec, poses: Poses) -> Array:
    """Return the joint positions that put the feet where they are, limits apart [rad], shape [num_frames, 12]."""
    assert poses.feet is not None
    rotation = to_rotation(poses.root_orientation).as_matrix()
    return leg_angles(spec, np.einsum("tji,tkj->tki", rotation, poses.feet - poses.root_position[:, None]))


def lowest_body_point(spec: RobotSpec, position: Array, orientation: Array, joints: Array) -> Array:
    """Return the height of the lowest point of trunk, head and knees over the floor [m], shape [num_frames]."""
    front, rear = part_heights(spec, position, orientation, joints)
    return np.minimum(front.min(axis=1), rear.min(axis=1))


def part_heights(spec: RobotSpec, position: Array, orientation: Array, joints: Array) -> tuple[Array, Array]:
    """Return the heights of the lowest points of parts over the floor [m].

    Returns:
        At the front two knees, two lower corners of the trunk and the head, shape [num_frames, 5]; knees and corners at
        the rear, shape [num_frames, 4].
    """
    rotation = to_rotation(orientation).as_matrix()

    def heights(points_b: Array) -> Array:
        return np.einsum("tj,tkj->tk", rotation[:, 2], points_b) + position[:, 2:]

    corners = 0.5 * np.array(spec.trunk_size) * [[x, y, -1.0] for x in (1.0, -1.0) for y in (1.0, -1.0)]
    knees = heights(leg_points(spec, joints)[:, :, 2]) - spec.thigh_radius
    trunk = heights(np.broadcast_to(corners, (len(position), 4, 3)))
    head = heights(np.broadcast_to(spec.head_centre, (len(position), 1, 3))) - spec.head_radius
    front = np.concatenate([knees[:, :2], trunk[:, :2], head], axis=1)
    return front, np.concatenate([knees[:, 2:], trunk[:, 2:]], axis=1)


def above_floor(poses: Poses, frame_duration: float, spec: RobotSpec) -> Poses:
    """Return the poses with the base raised where trunk, head or knees would be below the floor."""
    assert poses.feet is not None
    for _ in range(FLOOR_PASSES):
        position, orientation = poses.root_position, poses.root_orientation
        lowest = lowest_body_point(spec, position, orientation, joints_for(spec, poses))
        if lowest.min() >= 0.0:
            break
        position = position.copy()
        position[:, 2] += smooth_shift(np.maximum(-lowest, 0.0) * 1.05, ramp_frames(frame_duration))
        poses = replace(poses, root_position=position)
    return poses
