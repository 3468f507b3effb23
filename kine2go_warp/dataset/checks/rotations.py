"""Rotations from quaternions (w, x, y, z) in double precision; NaN stays NaN."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def matrices(wxyz: Array) -> Array:
    """Return rotation matrices, shape [..., 3, 3], of quaternions of any length but zero, shape [..., 4]."""
    w, x, y, z = np.moveaxis(wxyz / np.linalg.norm(wxyz, axis=-1, keepdims=True), -1, 0)
    rows = (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def turned(rotation: Array, vectors: Array) -> Array:
    """Turn vectors, shape [..., n, 3], by matrices, shape [..., 3, 3]."""
    return np.einsum("...ij,...kj->...ki", rotation, vectors)


def turn_between(before: Array, after: Array) -> Array:
    """Return the rotation vector in the world frame that leads from one quaternion to another [rad], shape [..., 3]."""
    w1, x1, y1, z1 = np.moveaxis(after, -1, 0)
    w2, x2, y2, z2 = np.moveaxis(before, -1, 0)
    real = w1 * w2 + x1 * x2 + y1 * y2 + z1 * z2
    imaginary = np.stack(
        [
            -w1 * x2 + x1 * w2 - y1 * z2 + z1 * y2,
            -w1 * y2 + x1 * z2 + y1 * w2 - z1 * x2,
            -w1 * z2 - x1 * y2 + y1 * x2 + z1 * w2,
        ],
        axis=-1,
    )
    imaginary = imaginary * np.where(real < 0.0, -1.0, 1.0)[..., None]
    sine = np.linalg.norm(imaginary, axis=-1)
    angle = 2.0 * np.arctan2(sine, np.abs(real))
    return imaginary * np.divide(angle, sine, out=np.full_like(angle, 2.0), where=sine > 1e-12)[..., None]


def heading(rotation: Array) -> Array:
    """Return the yaw of the forward axis seen from above [rad], NaN where it points up or down, shape [...]."""
    x, y = rotation[..., 0, 0], rotation[..., 1, 0]
    return np.where(np.hypot(x, y) > 0.5, np.arctan2(y, x), np.nan)


def level(rotation: Array) -> Array:
    """Return rotations with their heading taken out, shape [..., 3, 3]."""
    yaw = np.arctan2(rotation[..., 1, 0], rotation[..., 0, 0])
    return np.einsum("...ji,...jk->...ik", about_z(yaw), rotation)


def about_z(angle: Array) -> Array:
    """Return rotation matrices about the z axis, shape [..., 3, 3]."""
    cosine, sine = np.cos(angle), np.sin(angle)
    zero, one = np.zeros_like(cosine), np.ones_like(cosine)
    rows = ((cosine, -sine, zero), (sine, cosine, zero), (zero, zero, one))
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def wrapped(angle: Array) -> Array:
    """Return angles in [-pi, pi) [rad]."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi
