"""Unit quaternions (w, x, y, z) and rotations in NumPy, over any leading dimensions; NaN stays NaN.

Only the functions that convert to and from SciPy's rotations import SciPy, so that loading a dataset needs NumPy alone.
The kernels and ``deployment`` have rotations of their own: they check this one, and each other.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]


def multiply(a: NDArray[Any], b: NDArray[Any]) -> Array:
    """Return the product of quaternions, shape [..., 4]: the rotation ``b`` followed by the rotation ``a``."""
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    real = a[..., :1] * b[..., :1] - np.sum(a[..., 1:] * b[..., 1:], axis=-1, keepdims=True)
    imaginary = a[..., :1] * b[..., 1:] + b[..., :1] * a[..., 1:] + np.cross(a[..., 1:], b[..., 1:])
    return np.concatenate([real, imaginary], axis=-1)


def conjugate(wxyz: NDArray[Any]) -> Array:
    """Return the inverse rotations, shape [..., 4]."""
    return np.asarray(wxyz, np.float64) * (1.0, -1.0, -1.0, -1.0)


def rotate(wxyz: NDArray[Any], vectors: ArrayLike) -> Array:
    """Rotate vectors of shape [..., 3]."""
    wxyz, vectors = np.asarray(wxyz, np.float64), np.asarray(vectors)
    twice = 2.0 * np.cross(wxyz[..., 1:], vectors)
    return vectors + wxyz[..., :1] * twice + np.cross(wxyz[..., 1:], twice)


def rotation_vector(wxyz: NDArray[Any]) -> Array:
    """Return axis times angle [rad] of the shorter way round, shape [..., 3]."""
    wxyz = np.asarray(wxyz, np.float64)
    wxyz = np.where(wxyz[..., :1] < 0.0, -wxyz, wxyz)
    sine = np.linalg.norm(wxyz[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, wxyz[..., :1])
    return wxyz[..., 1:] * np.where(sine > 1e-12, angle / np.where(sine > 1e-12, sine, 1.0), 2.0)


def rotation_between(before: NDArray[Any], after: NDArray[Any]) -> Array:
    """Return the rotation vector in the world frame that leads from one orientation to another [rad], [..., 3]."""
    return rotation_vector(multiply(after, conjugate(before)))


def rotation_angle(a: NDArray[Any], b: NDArray[Any]) -> Array:
    """Return the angle between orientations [rad], shape [...], from shape [..., 4]."""
    # |a - b| and |a + b| of the closer sign: exact for small angles, where the arc cosine of a product is not.
    apart = np.linalg.norm(np.asarray(a, np.float64) - b, axis=-1)
    together = np.linalg.norm(np.asarray(a, np.float64) + b, axis=-1)
    return 4.0 * np.arctan2(np.minimum(apart, together), np.maximum(apart, together))


def heading(wxyz: NDArray[Any]) -> Array:
    """Return the yaw of the forward axis seen from above [rad], shape [...], of quaternions of any length but 0."""
    w, x, y, z = np.moveaxis(np.asarray(wxyz, np.float64), -1, 0)
    norm = np.sqrt(x * x + y * y + z * z + w * w)
    w, x, y, z = w / norm, x / norm, y / norm, z / norm
    return np.arctan2(2.0 * (x * y + z * w), x * x - y * y - z * z + w * w)


def to_matrices(wxyz: NDArray[Any]) -> Array:
    """Return rotation matrices, shape [..., 3, 3], of quaternions of any length but 0, shape [..., 4]."""
    w, x, y, z = np.moveaxis(wxyz / np.linalg.norm(wxyz, axis=-1, keepdims=True), -1, 0)
    rows = (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def rotate_by_matrices(matrices: Array, vectors: Array) -> Array:
    """Rotate vectors, shape [..., n, 3], by matrices, shape [..., 3, 3]."""
    return np.einsum("...ij,...kj->...ki", matrices, vectors)


def turn_planar(vectors: NDArray[Any], yaw: ArrayLike) -> Array:
    """Turn the first two components of vectors by ``yaw`` [rad]; a third one stays."""
    turned = np.array(vectors, dtype=np.float64)
    cosine, sine = np.cos(yaw), np.sin(yaw)
    turned[..., 0] = cosine * vectors[..., 0] - sine * vectors[..., 1]
    turned[..., 1] = sine * vectors[..., 0] + cosine * vectors[..., 1]
    return turned


def wrap_angle(angle: ArrayLike) -> Array:
    """Return the same angle in [-pi, pi) [rad]."""
    return (np.asarray(angle) + np.pi) % (2.0 * np.pi) - np.pi


def continuous(wxyz: NDArray[Any], axis: int = 0) -> Array:
    """Flip signs along an axis so that no two neighbours point in opposite directions.

    The first quaternion gets a non-negative real part.
    """
    quaternions = np.moveaxis(np.asarray(wxyz), axis, 0)
    first = np.where(quaternions[:1, ..., 0] < 0.0, -1.0, 1.0)
    # A neighbour already flipped changes the sign of the next product, hence the running product of the signs.
    signs = np.where(np.sum(quaternions[1:] * quaternions[:-1], axis=-1) < 0.0, -1.0, 1.0)
    signs = np.cumprod(np.concatenate([first, signs]), axis=0)[..., None].astype(quaternions.dtype)
    return np.moveaxis(quaternions * signs, 0, axis)


def to_rotation(wxyz: NDArray[Any]) -> "Rotation":
    """Return SciPy rotations from quaternions, shape [num_frames, 4]."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(np.asarray(wxyz)[..., [1, 2, 3, 0]])


def from_rotation(rotation: "Rotation") -> Array:
    """Return quaternions (w, x, y, z) from SciPy rotations."""
    return rotation.as_quat()[..., [3, 0, 1, 2]]


def from_matrices(matrices: NDArray[Any]) -> Array:
    """Return sign-continuous quaternions from rotation matrices, shape [num_frames, 3, 3]."""
    from scipy.spatial.transform import Rotation

    return continuous(from_rotation(Rotation.from_matrix(matrices)))


def yaw_rotation(yaw: ArrayLike) -> "Rotation":
    """Return rotations about the z axis by ``yaw`` [rad]."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(np.asarray(yaw)[..., None] * np.array([0.0, 0.0, 1.0]))


def turn_between(first: Array, second: Array) -> Array:
    """Return the rotation vectors that lead from one set of rotation matrices to another [rad], shape [..., 3]."""
    between = second @ np.swapaxes(first, -1, -2)
    skew = 0.5 * (between - np.swapaxes(between, -1, -2))
    axis = np.stack([skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]], axis=-1)
    sine = np.linalg.norm(axis, axis=-1, keepdims=True)
    angle = np.arctan2(sine, 0.5 * (np.trace(between, axis1=-2, axis2=-1)[..., None] - 1.0))
    return axis * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 1.0)
