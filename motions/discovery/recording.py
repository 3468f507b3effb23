"""A recording as the search looks at it: poses, feet that stand, postures and stillness, all in the robot's size."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.motions.keypoints import KeypointMotion
from kine2go_warp.motions.own_file import OwnFile
from kine2go_warp.motions.poses import Poses
from kine2go_warp.motions.proportions import HIP_HEIGHT
from kine2go_warp.motions.sources import MotionSource
from kine2go_warp.motions.stance import detect_stance
from kine2go_warp.motions.targets import pose_targets
from kine2go_warp.robots import RobotSpec
from kine2go_warp.rotations import heading, to_rotation, turn_planar

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

STILL_SPEED = 0.12
"""An animal is still while none of its points, in the robot's size, is faster than this [m/s]."""
SMOOTHING = 0.1
"""Standard deviation of the filter before speeds are taken [s]."""
LOW_HIPS = 0.6
"""Hips below this share of their usual height are lowered: the hind ones to sit, all four to lie."""
LEAST_USUAL = 0.8
"""Usual hips are at least this share of the robot's own height: a recording may be of an animal that lies all along."""


@dataclass(frozen=True)
class Recording:
    """One motion file, in the robot's size, the floor at height 0."""

    path: Path
    source: MotionSource
    motion: KeypointMotion
    """As the source delivers it."""
    targets: Poses
    """Poses that the robot should take, with feet."""
    stance: Mask
    """Whether each foot stands, shape [num_frames, 4]."""
    velocity: Array
    """Of the base along its heading, to its left and up [m/s], shape [num_frames, 3]."""
    yaw: Array
    """Heading, without jumps [rad], shape [num_frames]."""
    still: Mask
    """Whether the animal is still, shape [num_frames]."""
    posture: NDArray[np.str_]
    """``up``, ``sit`` or ``lie``, shape [num_frames]."""

    @property
    def rate(self) -> float:
        """Frames per second [Hz]."""
        return self.motion.rate

    @property
    def duration(self) -> float:
        """Of the recording [s]."""
        return self.motion.num_frames / self.rate


def read_recording(file: OwnFile, spec: RobotSpec, own: Path | None = None) -> Recording:
    """Read a motion file and find what the search goes by.

    Args:
        file: The file and how to read it.
        spec: The robot.
        own: A catalogue whose sources are known besides the package's.

    Raises:
        ClipError: the file is missing or damaged, or no source reads it.
        CatalogueError: there is no such source.
    """
    source = file.reader(own)
    motion = source.load(file.path, file.rate or None)
    targets = pose_targets(motion, source, spec)
    assert targets.feet is not None
    scaled, step = motion.scaled(source.proportions(spec).scale), 1.0 / motion.rate
    toes, heights = scaled.points("toe"), targets.feet[..., 2:] - spec.foot_radius
    stance = detect_stance(np.concatenate([toes[..., :2], heights], axis=-1), step, RetargetConfig())
    width = SMOOTHING / step
    yaw: Array = np.unwrap(heading(targets.root_orientation)).astype(np.float64)
    velocity = np.gradient(gaussian_filter1d(targets.root_position, width, axis=0), step, axis=0)
    speed = np.linalg.norm(np.gradient(gaussian_filter1d(scaled.position, width, axis=0), step, axis=0), axis=-1)
    hips = scaled.points("hip")[..., 2]
    usual = np.quantile(hips - toes[..., 2], 0.9, axis=0)
    return Recording(
        path=file.path,
        source=source,
        motion=motion,
        targets=targets,
        stance=stance,
        velocity=turn_planar(velocity, -gaussian_filter1d(yaw, width)),
        yaw=yaw,
        still=speed.max(axis=1) < STILL_SPEED,
        posture=postures(hips - np.quantile(toes[..., 2], 0.05), usual, spec),
    )


def postures(hips: Array, usual: Array, spec: RobotSpec) -> NDArray[np.str_]:
    """Return the posture of each frame.

    Args:
        hips: Heights of the hips over the floor [m], shape [num_frames, 4].
        usual: Their heights over the toes of long legs [m], shape [4].
        spec: The robot.
    """
    usual = np.maximum(usual, LEAST_USUAL * HIP_HEIGHT * spec.size)
    low = np.stack([hips[:, pair].mean(axis=1) < LOW_HIPS * usual[pair].mean() for pair in ([0, 1], [2, 3])], axis=1)
    return np.select([low.all(axis=1), low[:, 1]], ["lie", "sit"], "up")


def tilt(poses: Poses) -> Array:
    """Return the world's vertical in the frame of the base, forward and left part, shape [num_frames, 2]."""
    return to_rotation(poses.root_orientation).as_matrix()[:, 2, :2]
