"""From an animal's keypoints to the poses that the robot's base and feet should take (paper, section 3.1)."""

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.floor import fit_floor
from kine2go_warp.motions.keypoints import KeypointMotion
from kine2go_warp.motions.poses import Poses
from kine2go_warp.motions.sources.base import MotionSource
from kine2go_warp.robots import RobotSpec
from kine2go_warp.rotations import from_matrices, heading, to_rotation, turn_planar

Array = NDArray[np.float64]

FLOOR_REACH = 0.02
"""A foot below this height reaches the floor [m]."""
LONGEST_FLIGHT = 0.6
"""Largest share of a cycle that an animal is in the air."""


def pose_targets(motion: KeypointMotion, source: MotionSource, spec: RobotSpec, standing: Array | None = None) -> Poses:
    """Map an animal's keypoints onto the robot: poses with feet, in the source's frame with the floor at height 0.

    The base sits below the midpoint of pelvis and neck and looks from pelvis to neck. Each foot lies where the
    animal's toe lies relative to its hip, seen from the robot's own hip, moved outwards by the width of the thigh. A
    toe standing on the animal's floor becomes a foot standing on the robot's: the foot's *centre* is one foot radius
    up, and the base rises by the mean of what the feet rise.

    Args:
        motion: The animal's motion.
        source: How its size maps to the robot's.
        spec: The robot.
        standing: What ``standing_height`` says of the scaled motion, if it is known already [m], shape [4].

    Raises:
        ClipError: the animal's body has no extent, so that it has no forward direction.
    """
    scaled = motion.scaled(source.scale)
    orientation = root_orientation(scaled, source.forward_lift)
    toes, hips = scaled.points("toe"), scaled.points("hip")
    stance_height = standing_height(scaled) if standing is None else standing

    root = 0.5 * (scaled.point("pelvis") + scaled.point("neck"))
    root[:, 2] += spec.foot_radius - float(stance_height.mean()) - source.root_drop

    hip_offsets = np.array([leg.hip_offset for leg in spec.legs])
    rotation = to_rotation(orientation).as_matrix()
    robot_hips = root[:, None] + np.einsum("tij,kj->tki", rotation, hip_offsets)
    feet = robot_hips + toes - hips
    outward = np.zeros((len(root), 4, 3))
    outward[..., 1] = source.foot_outward * np.sign(hip_offsets[:, 1])
    feet += turn_planar(outward, heading(orientation)[:, None])
    feet[..., 2] = spec.foot_radius + np.maximum(toes[..., 2] - stance_height, 0.0)
    return Poses(root, orientation, feet=feet)


def standing_height(motion: KeypointMotion) -> Array:
    """Return the height of each toe while it stands on a level floor [m], shape [4]; their mean is the floor."""
    return fit_floor(motion, is_level=True)[1]


def reach_remarks(height: Array) -> tuple[str, ...]:
    """Return a remark if no foot is near the floor for longer than any animal flies.

    Args:
        height: Of the feet's lowest points over the floor [m], shape [num_frames, 4].
    """
    share = float(np.mean(height.min(axis=1) > FLOOR_REACH))
    if share <= LONGEST_FLIGHT:
        return ()
    return (f"no foot reaches the floor in {100.0 * share:.0f} % of the frames",)


def root_orientation(motion: KeypointMotion, forward_lift: float) -> Array:
    """Return the orientation of the trunk (w, x, y, z), shape [num_frames, 4].

    Forward is the direction from pelvis to (lifted) neck, left the mean of the lines across shoulders and hips.
    """
    forward = motion.point("neck") - motion.point("pelvis") + np.array([0.0, 0.0, forward_lift])
    hips = motion.points("hip")
    left = (hips[:, 0] - hips[:, 1]) + (hips[:, 2] - hips[:, 3])
    x = _unit(forward)
    y = _unit(left - np.sum(left * x, axis=-1, keepdims=True) * x)
    return from_matrices(np.stack([x, y, np.cross(x, y)], axis=-1, dtype=np.float64))


def _unit(vectors: Array) -> Array:
    """Return vectors of length 1."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    if not np.all(length >= 1e-6):
        frame = int(np.argmin(np.nan_to_num(length)))
        raise ClipError(f"frame {frame}: the animal's trunk has no length or no width, so it has no orientation")
    return np.asarray(vectors / length, dtype=np.float64)
