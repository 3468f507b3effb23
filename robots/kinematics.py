"""Closed-form forward kinematics in NumPy, vectorised over any leading dimensions, in double precision."""

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.robots.spec import Leg, RobotSpec
from kine2go_warp.rotations import rotate

Array = NDArray[np.float64]


class HasLegs(Protocol):
    """A robot, or as much of one as its legs."""

    @property
    def legs(self) -> tuple[Leg, ...]:
        """FL, FR, RL, RR."""
        ...


def leg_points(spec: HasLegs, joint_position: Array) -> Array:
    """Return hip, thigh and calf joint centres and foot centres in the base frame.

    Args:
        spec: The robot.
        joint_position: Joint positions [rad], shape [..., 12].

    Returns:
        Positions [m], shape [..., 4 legs, 4 points, 3].
    """
    angles = np.asarray(joint_position, dtype=np.float64).reshape(*np.shape(joint_position)[:-1], len(spec.legs), 3)
    roll, pitch, knee = np.moveaxis(angles, -1, 0)
    hip, beside, thigh_length, calf_length = _dimensions(spec)
    hip = np.broadcast_to(hip, angles.shape)
    thigh = hip + _rotate_x(roll, np.broadcast_to(beside, angles.shape))
    calf = thigh + _rotate_x(roll, _down(pitch, thigh_length))
    foot = calf + _rotate_x(roll, _down(pitch + knee, calf_length))
    return np.stack([hip, thigh, calf, foot], axis=-2)


def _dimensions(spec: HasLegs) -> tuple[Array, Array, Array, Array]:
    """Return hip and thigh offsets, shape [4 legs, 3], and lengths of thighs and calves, shape [4 legs] [m]."""
    legs = spec.legs
    offsets = np.array([(leg.hip_offset, leg.thigh_offset) for leg in legs])
    thigh, calf = np.array([(leg.thigh_length, leg.calf_length) for leg in legs]).T
    return offsets[:, 0], offsets[:, 1], thigh, calf


def link_positions(spec: RobotSpec, joint_position: Array) -> Array:
    """Return the points named by ``RobotSpec.link_names`` in the base frame [m], shape [..., 16, 3]."""
    points = leg_points(spec, joint_position)
    joints = points[..., :3, :].reshape(*points.shape[:-3], 12, 3)
    return np.concatenate([joints, points[..., 3, :]], axis=-2)


def foot_positions(spec: HasLegs, joint_position: Array) -> Array:
    """Return the foot centres in the base frame [m], shape [..., 4, 3]."""
    return leg_points(spec, joint_position)[..., 3, :]


def _down(pitch: Array, length: Array) -> Array:
    """Return the vector of a link that hangs straight down at zero pitch, turned about the y axis."""
    return np.stack([-length * np.sin(pitch), np.zeros_like(pitch), -length * np.cos(pitch)], axis=-1)


def _rotate_x(angle: Array, vector: Array) -> Array:
    """Turn vectors about the x axis."""
    cosine, sine = np.cos(angle), np.sin(angle)
    x, y, z = np.moveaxis(vector, -1, 0)
    return np.stack([x, cosine * y - sine * z, sine * y + cosine * z], axis=-1)


def link_rotations(spec: RobotSpec, joint_position: Array) -> Array:
    """Return the orientations of the links named by ``RobotSpec.link_names`` in the base frame, shape [..., 16, 3, 3].

    A foot is fixed to its calf.
    """
    angles = np.asarray(joint_position, dtype=np.float64).reshape(*np.shape(joint_position)[:-1], len(spec.legs), 3)
    pitch = np.cumsum(angles * (0.0, 1.0, 1.0), axis=-1)
    axis = np.broadcast_to([0.0, 1.0, 0.0], (*pitch.shape, 3))
    forward = np.stack([np.cos(pitch), np.zeros_like(pitch), -np.sin(pitch)], axis=-1)
    up = np.stack([np.sin(pitch), np.zeros_like(pitch), np.cos(pitch)], axis=-1)
    turned = np.stack([_rotate_x(angles[..., :1], column) for column in (forward, axis, up)], axis=-1)
    joints = turned.reshape(*turned.shape[:-4], 3 * len(spec.legs), 3, 3)
    return np.concatenate([joints, turned[..., 2, :, :]], axis=-3)


def link_turning(spec: RobotSpec, joint_position: Array, joint_velocity: Array) -> Array:
    """Return the angular velocities of those links relative to the base, in the base frame [rad/s], [..., 16, 3]."""
    shape = (*np.shape(joint_position)[:-1], len(spec.legs), 3)
    hip, rates = np.asarray(joint_position, np.float64).reshape(shape)[..., :1], np.reshape(joint_velocity, shape)
    # The hip turns about x; thigh and knee turn about the y axis of the hip.
    pitch = np.cumsum(np.asarray(rates, np.float64) * (0.0, 1.0, 1.0), axis=-1)
    roll = np.broadcast_to(rates[..., :1], pitch.shape)
    turning = np.stack([roll, np.cos(hip) * pitch, np.sin(hip) * pitch], axis=-1)
    joints = turning.reshape(*shape[:-2], 3 * len(spec.legs), 3)
    return np.concatenate([joints, turning[..., 2, :]], axis=-2)


def shank_rotations(spec: RobotSpec, joint_position: Array) -> Array:
    """Return the orientations of the calf links in the base frame, shape [..., 4, 3, 3]."""
    return link_rotations(spec, joint_position)[..., -len(spec.legs) :, :, :]


def contact_velocity(foot_velocity: Array, angular_velocity: Array, radius: float) -> Array:
    """Return the velocity of the lowest point of foot spheres, the point that touches the floor.

    A foot that rolls over its contact has a moving centre and a contact point at rest, so slip is measured here. The
    point's place is ``(0, 0, -radius)`` from the centre in the world frame.

    Args:
        foot_velocity: Of the foot's centre, world frame [m/s], shape [..., 3].
        angular_velocity: Of the shank that the foot is fixed to, world frame [rad/s], shape [..., 3].
        radius: Of the sphere [m].
    """
    turning = np.asarray(angular_velocity)
    rolling = np.stack([-turning[..., 1], turning[..., 0], np.zeros_like(turning[..., 0])], axis=-1)
    return np.asarray(foot_velocity) + radius * rolling


def contact_velocities(spec: RobotSpec, rows: Mapping[str, NDArray[Any]]) -> Array:
    """Return the velocities of the lowest points of the feet [m/s], world frame, shape [..., 4, 3].

    Args:
        spec: The robot.
        rows: Row arrays of a dataset by name: velocities of the links, orientation and angular velocity of the root,
            positions and velocities of the joints, each of shape [..., *row].
    """
    shanks_b = link_turning(spec, rows["joint_position"], rows["joint_velocity"])[..., -len(spec.legs) :, :]
    turning = rotate(rows["root_orientation"][..., None, :], shanks_b) + rows["root_angular_velocity"][..., None, :]
    feet = np.asarray(rows["link_linear_velocity"], np.float64)[..., -len(spec.legs) :, :]
    return contact_velocity(feet, turning, spec.foot_radius)


def leg_angles(spec: RobotSpec, feet_b: Array) -> Array:
    """Return the joint positions that put the feet somewhere, knees bent backwards [rad], shape [..., 12].

    Feet out of reach are taken to lie on the edge of the reach, in the same direction; limits are not looked at. The
    thigh joint must lie beside the hip joint, as the Go2's does.

    Args:
        spec: The robot.
        feet_b: Foot centres in the base frame [m], shape [..., 4, 3].
    """
    hip, beside, thigh, calf = _dimensions(spec)
    x, y, z = np.moveaxis(feet_b - hip, -1, 0)
    width = beside[:, 1]
    down = np.sqrt(np.maximum(y**2 + z**2 - width**2, 1e-12))
    roll = np.arctan2(z, y) - np.arctan2(-down, width)
    cosine = (x**2 + down**2 - thigh**2 - calf**2) / (2.0 * thigh * calf)
    knee = -np.arccos(np.clip(cosine, -1.0, 1.0))
    pitch = np.arctan2(-x, down) - np.arctan2(calf * np.sin(knee), thigh + calf * np.cos(knee))
    roll = (roll + np.pi) % (2.0 * np.pi) - np.pi
    angles = np.stack([roll, pitch, knee], axis=-1)
    return angles.reshape(*angles.shape[:-2], 12)
