"""Rotations of a single body in NumPy: quaternions (w, x, y, z) and matrices whose columns are the body's axes."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def to_matrix(wxyz: NDArray[Any]) -> Array:
    """Return the rotation matrix of a quaternion, shape [3, 3]."""
    w, x, y, z = np.asarray(wxyz, np.float64) / np.linalg.norm(wxyz)
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def about_z(angle: float) -> Array:
    """Return the matrix of a turn about the vertical axis [rad], shape [3, 3]."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def heading(rotation: Array) -> float:
    """Return the direction of the forward axis seen from above [rad]."""
    return float(np.arctan2(rotation[1, 0], rotation[0, 0]))


def between(start: Array, end: Array, fraction: float) -> Array:
    """Return the rotation that lies a fraction of the way from one to another, at an even rate about one axis."""
    turn = start.T @ end
    # Twice the axis times the sine of the angle; its cosine is in the trace.
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    length = float(np.linalg.norm(axis))
    if length < 1e-12:
        return start
    angle = fraction * np.arctan2(length, np.trace(turn) - 1.0)
    x, y, z = axis / length
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    # Rodrigues' formula.
    return start @ (np.eye(3) + np.sin(angle) * skew + (1.0 - np.cos(angle)) * (skew @ skew))
