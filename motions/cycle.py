"""Cycles: the displacement of one period, the closing of a seam, and the continuation beyond the ends."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from kine2go_warp.rotations import (
    continuous,
    from_rotation,
    heading,
    to_rotation,
    turn_planar,
    wrap_angle,
    yaw_rotation,
)

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CycleStep:
    """Where one period leads: a translation in the ground plane and a turn, as seen from frame 0."""

    x: float
    """Forward displacement [m]."""
    y: float
    """Displacement to the left [m]."""
    yaw: float
    """Turn about the z axis [rad]."""

    def repeated(self, cycles: int) -> "CycleStep":
        """Return the displacement of several periods; a negative number goes back in time."""
        position, yaw = np.zeros(3), 0.0
        for _ in range(abs(cycles)):
            position += turn_planar(np.array([self.x, self.y, 0.0]), yaw)
            yaw += self.yaw
        if cycles < 0:
            position, yaw = turn_planar(-position, -yaw), -yaw
        return CycleStep(float(position[0]), float(position[1]), float(yaw))

    def apply(self, position: Array, orientation: Array) -> tuple[Array, Array]:
        """Move poses on by this displacement: positions [..., 3], quaternions (w, x, y, z) [..., 4]."""
        moved = turn_planar(position, self.yaw) + np.array([self.x, self.y, 0.0])
        return moved, from_rotation(yaw_rotation(self.yaw) * to_rotation(orientation))


@dataclass(frozen=True)
class PoseSequence:
    """Root poses of successive frames, and what travels with the root."""

    root_position: Array
    """[m], shape [num_frames, 3]."""
    root_orientation: Array
    """(w, x, y, z), shape [num_frames, 4]."""
    channels: Array
    """Joint positions [rad], or feet in the root's heading frame [m], shape [num_frames, 12]."""


def extend_cyclically(
    root_position: Array, root_orientation: Array, channels: Array, cycle: CycleStep, before: int, after: int
) -> PoseSequence:
    """Continue a closed cycle by some frames on either side."""
    num_frames = len(root_position)
    frames = np.arange(-before, num_frames + after)
    positions = np.empty((len(frames), 3))
    orientations = np.empty((len(frames), 4))
    for turn in np.unique(frames // num_frames):
        chosen = frames // num_frames == turn
        index = frames[chosen] % num_frames
        positions[chosen], orientations[chosen] = cycle.repeated(int(turn)).apply(
            root_position[index], root_orientation[index]
        )
    return PoseSequence(positions, continuous(orientations), channels[frames % num_frames])


def recentred(poses: PoseSequence) -> PoseSequence:
    """Move a sequence so that frame 0 lies above the origin with heading 0; heights stay."""
    yaw = float(heading(poses.root_orientation[:1])[0])
    shift = poses.root_position[0] * np.array([1.0, 1.0, 0.0])
    return PoseSequence(
        turn_planar(poses.root_position - shift, -yaw),
        continuous(from_rotation(yaw_rotation(-yaw) * to_rotation(poses.root_orientation))),
        poses.channels,
    )


def with_extrapolated_frame(poses: PoseSequence) -> PoseSequence:
    """Append the frame that follows at the velocity of the last two, for a range that ends with its file."""
    last = to_rotation(poses.root_orientation[-1])
    step = last * to_rotation(poses.root_orientation[-2]).inv()
    return PoseSequence(
        np.vstack([poses.root_position, 2.0 * poses.root_position[-1] - poses.root_position[-2]]),
        np.vstack([poses.root_orientation, from_rotation(step * last)]),
        np.vstack([poses.channels, 2.0 * poses.channels[-1] - poses.channels[-2]]),
    )


def close_cycle(poses: PoseSequence, blend_frames: int) -> tuple[PoseSequence, CycleStep]:
    """Turn T + 1 recentred frames into a cycle of T frames whose continuation is exact.

    The last frame tells where the next cycle begins: its place in the ground plane and its heading become the cycle's
    displacement. What else differs between it and frame 0 (height, tilt, channels) is the seam; half of it is taken off
    the frames before the seam and half is added to those after it, fading out smoothly over ``blend_frames``.

    Returns:
        The T frames and the displacement of one period.
    """
    num_frames = len(poses.root_position) - 1
    end_yaw = float(heading(poses.root_orientation[-1:])[0])
    end = poses.root_position[-1]
    cycle = CycleStep(float(end[0]), float(end[1]), float(wrap_angle(end_yaw)))

    tilts = yaw_rotation(-heading(poses.root_orientation)) * to_rotation(poses.root_orientation)
    tilt_seam = (tilts[-1] * tilts[0].inv()).as_rotvec()
    weight = seam_weights(num_frames, blend_frames)[:, None]
    blended = from_rotation(Rotation.from_rotvec(weight * tilt_seam) * tilts[:-1])
    turn = heading(poses.root_orientation[:-1]) - heading(blended)
    orientation = continuous(from_rotation(yaw_rotation(turn) * to_rotation(blended)))
    position = poses.root_position[:-1].copy()
    position[:, 2] += weight[:, 0] * (end[2] - position[0, 2])
    channels = poses.channels[:-1] + weight * (poses.channels[-1] - poses.channels[0])
    return PoseSequence(position, orientation, channels), cycle


def seam_weights(num_frames: int, blend_frames: int) -> Array:
    """Return how much of the seam is added to each frame: +1/2 at frame 0, towards -1/2 just before the next cycle."""
    reach = max(min(blend_frames, num_frames // 2), 1)
    frames = np.arange(num_frames)
    after = _fade(frames / reach)
    before = _fade((num_frames - frames) / reach)
    return 0.5 * (after - before)


def _fade(distance: Array) -> Array:
    """Return 1 at distance 0, falling smoothly to 0 at distance 1 and beyond."""
    x = np.clip(1.0 - distance, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)
