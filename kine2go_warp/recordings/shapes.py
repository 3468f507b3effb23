"""Where the links of a robot are, row by row, computed with NumPy alone."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.robots import RobotSpec
from kine2go_warp.robots.kinematics import link_positions
from kine2go_warp.rotations import multiply, rotate

Array = NDArray[np.float32]


@dataclass(frozen=True)
class Poses:
    """A robot's links over some rows, in the world frame."""

    root_position: Array
    """Base link origin [m], shape [num_rows, 3]."""
    root_orientation: Array
    """Base link in the world, (w, x, y, z), shape [num_rows, 4]."""
    link_position: Array
    """Joint centres and feet, in the order of ``RobotSpec.link_names`` [m], shape [num_rows, 16, 3]."""
    hip: Array
    """Orientation of the hips, (w, x, y, z), shape [num_rows, 4, 4]."""
    thigh: Array
    """The same for the thighs."""
    calf: Array
    """The same for the calves."""

    @property
    def feet(self) -> Array:
        """Foot centres [m], shape [num_rows, 4, 3]."""
        return self.link_position[:, 12:]

    def rows(self, part: slice) -> "Poses":
        """Return some of the rows."""
        return Poses(*(getattr(self, field.name)[part] for field in fields(self)))

    def joint_centres(self, joint: int) -> Array:
        """Return the centres of all hips (0), thighs (1) or calves (2) [m], shape [num_rows, 4, 3]."""
        return self.link_position[:, joint:12:3]


def compute_poses(
    spec: RobotSpec,
    root_position: NDArray[Any],
    root_orientation: NDArray[Any],
    joint_position: NDArray[Any],
    link_position: NDArray[Any] | None = None,
) -> Poses:
    """Compute where the links of a robot are.

    Args:
        spec: The robot.
        root_position: Base link origin [m], shape [num_rows, 3].
        root_orientation: Base link in the world, (w, x, y, z), shape [num_rows, 4].
        joint_position: Joint positions [rad], shape [num_rows, 12].
        link_position: Joint centres and feet, where they are known [m], shape [num_rows, 16, 3]. By default they follow
            from the others.
    """
    base = np.asarray(root_orientation)[:, None]
    if link_position is None:
        inside = link_positions(spec, joint_position)
        link_position = root_position[:, None] + rotate(base, inside)
    angles = np.asarray(joint_position, np.float64).reshape(-1, len(spec.legs), 3)
    hip = multiply(base, about(0, angles[..., 0]))
    thigh = multiply(hip, about(1, angles[..., 1]))
    calf = multiply(thigh, about(1, angles[..., 2]))
    arrays = (root_position, root_orientation, link_position, hip, thigh, calf)
    return Poses(*(np.ascontiguousarray(values, np.float32) for values in arrays))


def robot_poses(spec: RobotSpec, rows: Mapping[str, NDArray[Any]]) -> Poses:
    """Return the robot of a trajectory, at the points that the dataset stores."""
    state = rows["root_position"], rows["root_orientation"], rows["joint_position"], rows["link_position"]
    return compute_poses(spec, *state)


def reference_poses(spec: RobotSpec, rows: Mapping[str, NDArray[Any]]) -> Poses:
    """Return the reference of a trajectory."""
    names = ("reference_root_position", "reference_root_orientation", "reference_joint_position")
    return compute_poses(spec, *(rows[name] for name in names))


def skeletons(poses: Poses) -> Array:
    """Return one line through each leg, from hip over thigh and calf to the foot [m], shape [num_rows, 4, 4, 3]."""
    parts = [poses.joint_centres(joint) for joint in range(3)]
    return np.stack([*parts, poses.feet], axis=2)


def about(axis: int, angle: NDArray[Any]) -> NDArray[np.float64]:
    """Return the turn by an angle [rad] about a coordinate axis, (w, x, y, z), shape [..., 4]."""
    turn = np.zeros((*np.shape(angle), 4))
    turn[..., 0], turn[..., 1 + axis] = np.cos(0.5 * angle), np.sin(0.5 * angle)
    return turn


def xyzw(quaternions: NDArray[Any]) -> NDArray[Any]:
    """Return quaternions (w, x, y, z) in the viewer's order."""
    return quaternions[..., [1, 2, 3, 0]]
