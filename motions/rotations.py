"""Quaternions in NumPy, (w, x, y, z), vectorised over leading dimensions. SciPy does the mathematics."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]


def to_rotation(wxyz: Array) -> Rotation:
    """Return SciPy rotations from quaternions, shape [num_frames, 4]."""
    return Rotation.from_quat(np.asarray(wxyz)[..., [1, 2, 3, 0]])


def from_rotation(rotation: Rotation) -> Array:
    """Return quaternions (w, x, y, z) from SciPy rotations."""
    return rotation.as_quat()[..., [3, 0, 1, 2]]


def from_matrices(matrices: Array) -> Array:
    """Return sign-continuous quaternions from rotation matrices, shape [num_frames, 3, 3]."""
    return continuous(from_rotation(Rotation.from_matrix(matrices)))


def continuous(wxyz: Array) -> Array:
    """Flip the signs along the first axis so that no two neighbours point in opposite directions.

    The first quaternion gets a non-negative real part.
    """
    quaternions = np.array(wxyz, dtype=np.float64)
    if quaternions[0, 0] < 0.0:
        quaternions[0] = -quaternions[0]
    dots = np.sum(quaternions[1:] * quaternions[:-1], axis=-1)
    # A neighbour already flipped changes the sign of the next product, hence the running product of the signs.
    signs = np.cumprod(np.where(dots < 0.0, -1.0, 1.0))
    quaternions[1:] *= signs[:, None]
    return quaternions


def heading(wxyz: Array) -> Array:
    """Return the yaw of the forward axis seen from above [rad]."""
    forward = to_rotation(wxyz).apply([1.0, 0.0, 0.0])
    return np.arctan2(forward[..., 1], forward[..., 0])


def yaw_rotation(yaw: Array | float) -> Rotation:
    """Return rotations about the z axis."""
    return Rotation.from_rotvec(np.asarray(yaw)[..., None] * np.array([0.0, 0.0, 1.0]))


def turn_planar(vectors: Array, yaw: Array | float) -> Array:
    """Turn the first two components of vectors by ``yaw`` [rad]; a third one stays."""
    turned = np.array(vectors, dtype=np.float64)
    cosine, sine = np.cos(yaw), np.sin(yaw)
    turned[..., 0] = cosine * vectors[..., 0] - sine * vectors[..., 1]
    turned[..., 1] = sine * vectors[..., 0] + cosine * vectors[..., 1]
    return turned


def wrap_angle(angle: Array | float) -> Array:
    """Return the same angle in [-pi, pi) [rad]."""
    return (np.asarray(angle) + np.pi) % (2.0 * np.pi) - np.pi


def turn_between(first: Array, second: Array) -> Array:
    """Return the rotation vectors that lead from one set of rotation matrices to another [rad], shape [..., 3]."""
    between = second @ np.swapaxes(first, -1, -2)
    skew = 0.5 * (between - np.swapaxes(between, -1, -2))
    axis = np.stack([skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]], axis=-1)
    sine = np.linalg.norm(axis, axis=-1, keepdims=True)
    angle = np.arctan2(sine, 0.5 * (np.trace(between, axis1=-2, axis2=-1)[..., None] - 1.0))
    return axis * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 1.0)
