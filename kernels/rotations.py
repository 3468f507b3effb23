"""Rotations shared by all kernels."""

import warp as wp


@wp.func
def wxyz(rotation: wp.quat) -> wp.vec4:
    """Return a quaternion in the order of the dataset."""
    return wp.vec4(rotation[3], rotation[0], rotation[1], rotation[2])


@wp.func
def yaw_rotation(yaw: float) -> wp.quat:
    """Return the rotation about the world's z axis by ``yaw`` [rad]."""
    return wp.quat(0.0, 0.0, wp.sin(0.5 * yaw), wp.cos(0.5 * yaw))


@wp.func
def rotate_planar(yaw: float, vector: wp.vec2) -> wp.vec2:
    """Turn a vector in the ground plane by ``yaw`` [rad]."""
    cosine = wp.cos(yaw)
    sine = wp.sin(yaw)
    return wp.vec2(cosine * vector[0] - sine * vector[1], sine * vector[0] + cosine * vector[1])


@wp.func
def heading_of(orientation: wp.quat) -> float:
    """Return the yaw of the forward axis seen from above [rad], in (-pi, pi]."""
    forward = wp.quat_rotate(orientation, wp.vec3(1.0, 0.0, 0.0))
    return wp.atan2(forward[1], forward[0])


@wp.func
def rotation_angle(a: wp.quat, b: wp.quat) -> float:
    """Return the angle between two orientations [rad], in [0, pi], whatever the signs of the quaternions.

    This is the norm of the axis-angle form of ``a * inverse(b)`` (paper, appendix, root pose reward). The arc tangent
    keeps small angles exact where an arc cosine would not.
    """
    error = a * wp.quat_inverse(b)
    return 2.0 * wp.atan2(wp.length(wp.vec3(error[0], error[1], error[2])), wp.abs(error[3]))


@wp.func
def slerp(a: wp.quat, b: wp.quat, fraction: float) -> wp.quat:
    """Interpolate between two orientations along the shorter arc."""
    cosine = wp.dot(a, b)
    target = b
    if cosine < 0.0:
        target = -b
        cosine = -cosine
    # The angle from the chord, not from acos(cosine): single precision has no digits left near 1.
    half_chord = 0.5 * wp.length(target - a)
    angle = 2.0 * wp.asin(wp.min(half_chord, 1.0))
    if angle < 1.0e-3:
        return wp.normalize(a * (1.0 - fraction) + target * fraction)
    return wp.normalize((a * wp.sin((1.0 - fraction) * angle) + target * wp.sin(fraction * angle)) / wp.sin(angle))
