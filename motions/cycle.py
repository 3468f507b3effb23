"""Cycles: the displacement of one period, the closing of a seam, and what lies beyond the ends of any clip."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from kine2go_warp.motions.poses import Poses
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


def continued(frames: NDArray[np.int_], num_frames: int, is_cycle: bool) -> NDArray[np.int_]:
    """Return which frames of a clip of ``num_frames`` are played at places that may lie beyond its ends.

    A cycle repeats; a clip that is played once stays at its first and its last frame.
    """
    return frames % num_frames if is_cycle else np.clip(frames, 0, num_frames - 1)


def rest_places(last: int, ramps: tuple[int, int], before: int, after: int) -> Array:
    """Return the places of a motion, frame by frame, that comes from rest at place 0 and to rest at place ``last``.

    Its speed of one place a frame rises and falls within ``ramps`` frames without a jump of speed or acceleration.
    Where a ramp is 0 it does not slow down and goes on beyond its end.

    Args:
        last: Place of the end [frames].
        ramps: Even numbers of frames, together at most twice ``last``.
        before: Frames before place 0.
        after: Frames after place ``last``.
    """
    start, end = ramps
    total = last + (start + end) // 2
    frames = np.arange(-before, total + after + 1)

    def passed(frame: NDArray[np.int_], ramp: int) -> Array:
        # The integral of 3 x^2 - 2 x^3.
        x = np.clip(frame / ramp, 0.0, 1.0)
        return ramp * (x**3 - 0.5 * x**4)

    places: Array = (frames - 0.5 * start).astype(np.float64)
    if start:
        places = np.where(frames < start, passed(frames, start), places)
    if end:
        places = np.where(total - frames < end, last - passed(total - frames, end), places)
    return places


def extend(poses: Poses, cycle: CycleStep | None, before: int, after: int) -> Poses:
    """Continue a clip by some frames on either side: a closed cycle repeats, without one the ends are held."""
    frames = np.arange(-before, len(poses) + after)
    if cycle is None:
        return poses.taken(continued(frames, len(poses), is_cycle=False))
    turns, index = np.divmod(frames, len(poses))
    steps = [cycle.repeated(turn) for turn in range(int(turns[0]), int(turns[-1]) + 1)]
    x, y, yaw = np.array([(step.x, step.y, step.yaw) for step in steps])[turns - turns[0]].T
    longer = poses.taken(index).moved(x, y, yaw)
    return replace(longer, root_orientation=continuous(longer.root_orientation))


def close_cycle(poses: Poses, num_frames: int, blend_frames: float) -> tuple[Poses, CycleStep]:
    """Turn the first frames of a motion into a cycle whose continuation is exact and smooth.

    Frame ``num_frames`` tells where the next cycle begins: its place in the ground plane and its heading become the
    cycle's displacement. What else differs between it and frame 0 (height, tilt, feet as seen from the base, joints) is
    the seam; half of it is taken off the frames before the seam and half is added to those after it, fading out over
    ``blend_frames``. The base's velocities, planar ones and the yaw rate included, are made to meet in the same way, by
    an offset that begins and ends with nothing.

    Args:
        poses: At least ``num_frames + 2`` frames.
        num_frames: Frames of one cycle.
        blend_frames: How far the seam is spread on either side [frames].

    Returns:
        The recentred cycle and the displacement of one period.
    """
    poses = poses.recentred()
    yaw: Array = np.unwrap(heading(poses.root_orientation)).astype(np.float64)
    value, slope = seam_weights(num_frames, blend_frames), seam_slopes(num_frames, blend_frames)
    # The last frames as the next cycle sees them, so that they can be compared with the first ones.
    following = poses.frames(num_frames, num_frames + 2).recentred().root_position
    velocity = np.diff(following, axis=0)[0] - np.diff(poses.root_position[:2], axis=0)[0]
    position = poses.root_position[: num_frames + 1].copy()
    position[:, 2] += np.append(value, -0.5) * (following[0, 2] - position[0, 2]) + np.append(slope, 0.0) * velocity[2]
    after, before = seam_distances(np.arange(num_frames, dtype=np.float64) + 0.5, num_frames, blend_frames)
    gained = 0.5 * np.outer(_fade(after), velocity[:2]) - 0.5 * np.outer(
        _fade(before), turn_planar(velocity[:2], yaw[num_frames])
    )
    position[1:, :2] += np.cumsum(gained, axis=0)
    cycle = CycleStep(float(position[-1, 0]), float(position[-1, 1]), float(wrap_angle(yaw[num_frames])))
    position = position[:-1]

    tilts = yaw_rotation(-yaw) * to_rotation(poses.root_orientation)
    at, after = tilts[num_frames : num_frames + 2], tilts[:2]
    seam = (at[0] * after[0].inv()).as_rotvec()
    rate = (at[1] * at[0].inv()).as_rotvec() - (after[1] * after[0].inv()).as_rotvec()
    blended = Rotation.from_rotvec(np.outer(value, seam) + np.outer(slope, rate)) * tilts[:num_frames]
    yaw_rate = (yaw[num_frames + 1] - yaw[num_frames]) - (yaw[1] - yaw[0])
    aim = yaw[:num_frames] + slope * yaw_rate
    orientation = yaw_rotation(aim - heading(from_rotation(blended))) * blended

    joints = feet = None
    if poses.joints is not None:
        joints = poses.joints[:num_frames] + np.outer(value, poses.joints[num_frames] - poses.joints[0])
    if poses.feet is not None:
        planar = np.array([1.0, 1.0, 0.0])
        reach = turn_planar(poses.feet - poses.root_position[:, None] * planar, -yaw[:, None])
        reach = reach[:num_frames] + value[:, None, None] * (reach[num_frames] - reach[0])
        feet = turn_planar(reach, aim[:, None]) + position[:, None] * planar
    return Poses(position, continuous(from_rotation(orientation)), joints, feet), cycle


def seam_weights(num_frames: int, blend_frames: float) -> Array:
    """Return how much of the seam is added to each frame: +1/2 at frame 0, towards -1/2 just before the next cycle."""
    after, before = seam_distances(np.arange(num_frames, dtype=np.float64), num_frames, blend_frames)
    return 0.5 * (_fade(after) - _fade(before))


def seam_slopes(num_frames: int, blend_frames: float) -> Array:
    """Return an offset [frames] whose slope jumps from -1/2 to +1/2 at the seam, where it is 0 itself.

    Times a difference of velocity a frame, it closes that difference and moves nothing beyond the blend.
    """
    near = np.minimum(*seam_distances(np.arange(num_frames, dtype=np.float64), num_frames, blend_frames))
    return 0.5 * blend_reach(num_frames, blend_frames) * near * np.maximum(1.0 - near, 0.0) ** 2


def blend_reach(num_frames: int, blend_frames: float) -> float:
    """Return how far the seam is spread: no further than a third of the cycle [frames]."""
    return max(min(blend_frames, num_frames / 3.0), 1.0)


def seam_distances(places: Array, num_frames: int, blend_frames: float) -> tuple[Array, Array]:
    """Return how far places [frames] are behind and before the seam, in parts of the reach of the blend."""
    reach = blend_reach(num_frames, blend_frames)
    return places / reach, (num_frames - places) / reach


def _fade(distance: Array) -> Array:
    """Return 1 at distance 0, falling smoothly to 0 at distance 1 and beyond."""
    x = np.clip(1.0 - distance, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


def cycle_between(poses: Poses, first: int, num_frames: int) -> CycleStep:
    """Return the displacement from a frame to the one a cycle later, as seen from the former."""
    ends = [first, first + num_frames]
    yaw = heading(poses.root_orientation[ends])
    offset = turn_planar(poses.root_position[ends[1]] - poses.root_position[ends[0]], -yaw[0])
    return CycleStep(float(offset[0]), float(offset[1]), float(wrap_angle(yaw[1] - yaw[0])))
