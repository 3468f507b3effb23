"""A film of a trajectory that the page draws itself, from the side: a few kilobytes instead of a video."""

import base64
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.renders.video import RenderedTrajectory
from kine2go_warp.robots import RobotSpec
from kine2go_warp.robots.kinematics import leg_points
from kine2go_warp.rotations import heading, rotate

RATE = 12.5
"""Pictures per second [Hz]."""
LONGEST = 10.0
"""Longest film [s]."""
TICKS = 0.25
"""Distance of the marks on the ground, which repeat themselves [m]."""


@dataclass(frozen=True)
class Film:
    """What the page draws: numbers in millimetres, 16 bits each, little-endian."""

    points: str
    """Hip, thigh, knee and foot of the legs of robot and reference, ahead of the robot's base and above the ground, as
    base64 of shape [num_pictures, 2, 4 legs, 4 points, 2]."""
    ground: str
    """Where the base is between two marks on the ground, as base64 of shape [num_pictures]."""
    rate: float = RATE
    ticks: int = round(1e3 * TICKS)


def film(trajectory: RenderedTrajectory, spec: RobotSpec) -> Film:
    """Return a film of the beginning of a trajectory, seen from its right side."""
    count = int(min(trajectory.time[-1], LONGEST) * RATE) + 1
    rows = [trajectory.row_at(number / RATE) for number in range(count)]
    ahead = heading(trajectory.rows["root_orientation"][0])
    direction = np.array([np.cos(ahead), np.sin(ahead), 0.0])
    base = trajectory.rows["root_position"][rows].astype(np.float64)
    both = np.stack([drawn_points(trajectory, rows, spec, prefix) for prefix in ("", "reference_")], axis=1)
    along = (both - base[:, None, None, None]) @ direction
    flat = np.stack([along, both[..., 2]], axis=-1)
    return Film(encoded(flat), encoded((base @ direction) % TICKS))


def drawn_points(trajectory: RenderedTrajectory, rows: list[int], spec: RobotSpec, prefix: str) -> NDArray[np.float64]:
    """Return the joints and feet of the legs in the world [m], shape [num_rows, 4, 4, 3]."""
    position, orientation, joints = (
        trajectory.rows[f"{prefix}{name}"][rows] for name in ("root_position", "root_orientation", "joint_position")
    )
    points_b = leg_points(spec, joints)
    return rotate(orientation[:, None, None], points_b) + position[:, None, None]


def encoded(metres: NDArray[np.float64]) -> str:
    """Return lengths as whole millimetres in base64."""
    limit = np.iinfo(np.int16).max
    return base64.b64encode(np.clip(np.rint(1e3 * metres), -limit, limit).astype("<i2").tobytes()).decode()
