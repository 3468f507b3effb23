"""Unit quaternions (w, x, y, z) in NumPy, over any leading dimensions."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def multiply(a: NDArray, b: NDArray) -> Array:
    """Return the product of quaternions, shape [..., 4]: the rotation ``b`` followed by the rotation ``a``."""
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    real = a[..., :1] * b[..., :1] - np.sum(a[..., 1:] * b[..., 1:], axis=-1, keepdims=True)
    imaginary = a[..., :1] * b[..., 1:] + b[..., :1] * a[..., 1:] + np.cross(a[..., 1:], b[..., 1:])
    return np.concatenate([real, imaginary], axis=-1)


def conjugate(wxyz: NDArray) -> Array:
    """Return the inverse rotations, shape [..., 4]."""
    return np.asarray(wxyz, np.float64) * (1.0, -1.0, -1.0, -1.0)


def rotate(wxyz: NDArray, vector: NDArray) -> Array:
    """Turn vectors of shape [..., 3]."""
    wxyz = np.asarray(wxyz, np.float64)
    twice = 2.0 * np.cross(wxyz[..., 1:], vector)
    return vector + wxyz[..., :1] * twice + np.cross(wxyz[..., 1:], twice)


def rotation_vector(wxyz: NDArray) -> Array:
    """Return axis times angle [rad] of the shorter way round, shape [..., 3]."""
    wxyz = np.asarray(wxyz, np.float64)
    wxyz = np.where(wxyz[..., :1] < 0.0, -wxyz, wxyz)
    sine = np.linalg.norm(wxyz[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, wxyz[..., :1])
    return wxyz[..., 1:] * np.where(sine > 1e-12, angle / np.where(sine > 1e-12, sine, 1.0), 2.0)


def yaw(wxyz: NDArray) -> Array:
    """Return the direction of the x axis in the plane [rad], shape [...]."""
    w, x, y, z = np.moveaxis(np.asarray(wxyz, np.float64), -1, 0)
    return np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
