"""Motions one after another as one clip that is played once: parts, and what leads from each to the next.

From part to part the base's velocities in its heading frame, its height and tilt, and the feet as seen from it are
blended, while the part before goes on beyond its end and the one after begins ahead of its beginning. The base's way
is integrated from the blended velocities, so that place and heading go on. Then the whole goes through the retargeting
of contacts as any animal's motion does: standing feet are held, and feet that stand elsewhere after a transition step
there, one diagonal pair after the other.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Slerp

from kine2go_warp.motions.body import hip_joints
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.motions.cycle import continued, rest_places
from kine2go_warp.motions.keypoints import KeypointMotion
from kine2go_warp.motions.parts import Part
from kine2go_warp.motions.poses import Poses
from kine2go_warp.robots import RobotSpec
from kine2go_warp.robots.kinematics import foot_positions
from kine2go_warp.rotations import continuous, from_rotation, heading, to_rotation, turn_planar, yaw_rotation

Array = NDArray[np.float64]

SHORTEST_TRANSITION, LONGEST_TRANSITION = 0.5, 2.0
"""[s]"""
SPEED_SHARE = 0.7
"""Share of the motors' speeds that blended joints may need, if the parts need no more."""
CYCLE_TIME = 2.0
"""How long a cycle is repeated at least where neither a number nor a time is given [s]."""
LEAST_STEP = 0.015
"""A foot that stands farther than this from where it stood before a transition steps there [m]."""
PAIRS = ((0, 3), (1, 2))
"""Legs that step together, the first pair in the first half of a transition."""
TRUNK_HALF_LENGTH = 0.2
"""Of the animal that is drawn beside the robot [m]."""


@dataclass(frozen=True)
class Track:
    """A motion as its base sees it, frame by frame: what can be blended with another one."""

    step_h: Array
    """Way to the next frame in the heading frame [m], shape [num_frames, 2]."""
    turn: Array
    """Turn to the next frame [rad], shape [num_frames, 1]."""
    height: Array
    """Of the base [m], shape [num_frames, 1]."""
    tilt: Array
    """Base orientation without its heading (w, x, y, z), shape [num_frames, 4]."""
    feet_h: Array
    """Feet from the point below the base, in the heading frame, heights over the floor [m], [num_frames, 4, 3]."""
    joints: Array
    """[rad], shape [num_frames, 12]."""
    stance: Array
    """1 where a foot stands, shape [num_frames, 4]."""
    rests: Array
    """1 where the front or the rear rests on the floor, shape [num_frames, 2]."""

    def __len__(self) -> int:
        return len(self.turn)

    def frames(self, start: int, stop: int) -> "Track":
        """Return some of the frames."""
        return Track(*(getattr(self, one.name)[start:stop] for one in fields(self)))

    def poses(self) -> Poses:
        """Return poses with feet, whose way is integrated from the origin."""
        yaw = np.concatenate([[0.0], np.cumsum(self.turn[:-1, 0])])
        ways = turn_planar(np.pad(self.step_h, [(0, 0), (0, 1)]), yaw)
        place = np.concatenate([np.zeros((1, 3)), np.cumsum(ways[:-1], axis=0)])
        orientation = continuous(from_rotation(yaw_rotation(yaw) * to_rotation(self.tilt)))
        feet = turn_planar(self.feet_h, yaw[:, None]) + place[:, None]
        return Poses(place + np.pad(self.height, [(0, 0), (2, 0)]), orientation, feet=feet)


def track_of(clip: MotionClip, spec: RobotSpec, places: Array) -> Track:
    """Return a clip at places within or beyond it [frames], which grow by even steps or stand still."""
    first, last = math.floor(places.min()) - 2, math.ceil(places.max()) + 4
    poses = clip.extended(max(-first, 0), max(last - clip.num_frames, 0))
    known = np.arange(len(poses)) - max(-first, 0)
    assert poses.joints is not None
    wanted = np.append(places, 2.0 * places[-1] - places[-2])
    position, joints = CubicSpline(known, poses.root_position)(wanted), CubicSpline(known, poses.joints)(wanted)
    rotation = Slerp(known, to_rotation(poses.root_orientation))(wanted)
    yaw: Array = np.unwrap(heading(from_rotation(rotation))).astype(np.float64)
    upright = yaw_rotation(-yaw) * rotation
    feet = np.einsum("tij,tkj->tki", upright.as_matrix(), foot_positions(spec, joints))
    feet[..., 2] += position[:, None, 2]
    near = continued(np.round(places).astype(int), clip.num_frames, clip.cycle is not None)
    return Track(
        step_h=turn_planar(np.diff(position, axis=0), -yaw[:-1])[:, :2],
        turn=np.diff(yaw)[:, None],
        height=position[:-1, 2:],
        tilt=continuous(from_rotation(upright))[:-1],
        feet_h=feet[:-1],
        joints=joints[:-1],
        stance=clip.stance[near],
        rests=clip.body_rests[near],
    )


def blended(one: Track, other: Track) -> Track:
    """Return what leads from one track to another within their frames; they are as long as one another."""
    x = (np.arange(len(one)) + 0.5) / len(one)
    share = x * x * (3.0 - 2.0 * x)

    def mixed(first: Array, second: Array) -> Array:
        weight = share.reshape(-1, *[1] * (first.ndim - 1))
        return (1.0 - weight) * first + weight * second

    values = {item.name: mixed(getattr(one, item.name), getattr(other, item.name)) for item in fields(Track)}
    same = np.where(np.sum(one.tilt * other.tilt, axis=1, keepdims=True) < 0.0, -1.0, 1.0)
    tilt = mixed(one.tilt, same * other.tilt)
    values["tilt"] = tilt / np.linalg.norm(tilt, axis=1, keepdims=True)
    for name in ("stance", "rests"):
        values[name] = np.where(share[:, None] < 0.5, getattr(one, name), getattr(other, name))
    return Track(**values)


@dataclass(frozen=True)
class Played:
    """A clip and how often it is repeated within a sequence."""

    clip: MotionClip
    cycles: int

    @classmethod
    def of(cls, clip: MotionClip, part: Part) -> "Played":
        """Return a part of a sequence. A cycle is repeated for the time that is asked for, in whole cycles."""
        seconds = part.seconds or CYCLE_TIME
        return cls(clip, part.cycles or (1 if clip.cycle is None else math.ceil(seconds / clip.period - 1e-6)))

    def frames(self, step: float) -> int:
        """Return how many steps of ``step`` [s] it takes."""
        return round(self.cycles * self.clip.period / step)

    def track(self, spec: RobotSpec, step: float, ramps: tuple[int, int], around: tuple[int, int]) -> Track:
        """Return it every ``step`` [s], coming from rest and to rest within ``ramps``, with frames before and after."""
        count = self.frames(step)
        scale = self.cycles * self.clip.span / count
        return track_of(self.clip, spec, scale * rest_places(count, ramps, *around))


def transition_frames(one: Played, other: Played, spec: RobotSpec, step: float) -> int:
    """Return in how many frames one part leads to the next, so that blended joints keep within their speeds."""
    limits = np.array(spec.joint_speed)
    needed = max(float((np.abs(part.clip.joint_velocity) / limits).max()) for part in (one, other))
    shortest, longest = round(SHORTEST_TRANSITION / step), round(LONGEST_TRANSITION / step)
    for frames in range(shortest, longest, max(round(0.05 / step), 1)):
        # What is before the end and after the beginning is not blended, but the speeds across both ends count.
        before = one.track(spec, step, (0, 0), (0, frames)).frames(one.frames(step) - 1, one.frames(step) + frames)
        after = other.track(spec, step, (0, 0), (frames, 0)).frames(0, frames + 1)
        middle = blended(before.frames(1, frames + 1), after.frames(0, frames))
        joints = np.concatenate([before.joints[:1], middle.joints, after.joints[frames:]])
        if (np.abs(np.diff(joints, axis=0)) / (step * limits)).max() <= max(SPEED_SHARE, needed):
            return frames
    return longest


def with_steps(track: Track, start: int, stop: int) -> Track:
    """Return a track in which feet that stand all through a transition, but move, step to their new places."""
    feet, stance, frames = track.poses().feet, track.stance.copy(), stop - start
    assert feet is not None
    for half, pair in enumerate(PAIRS):
        for foot in pair:
            moved = float(np.linalg.norm(feet[stop, foot, :2] - feet[start - 1, foot, :2]))
            if stance[start - 1 : stop + 1, foot].all() and moved > LEAST_STEP:
                first, last = (start + round((0.5 * half + edge) * frames) for edge in (0.05, 0.45))
                stance[first:last, foot] = 0.0
    return replace(track, stance=stance)


def joined(parts: Sequence[Played], spec: RobotSpec, step: float, hold: int, ramp: int) -> Track:
    """Return all parts and what leads from each to the next.

    Args:
        parts: The parts.
        spec: The robot.
        step: From frame to frame [s].
        hold: Frames for which a cycle at an end of the sequence is held at rest.
        ramp: Frames in which such a cycle comes from rest, or to rest.
    """
    leads = [transition_frames(one, other, spec, step) for one, other in pairwise(parts)]
    ends = [part.clip.cycle is not None for part in (parts[0], parts[-1])]
    around = [hold if ends[0] else 0, *leads, hold if ends[1] else 0]
    pieces, windows, length = [], [], 0
    before: Track | None = None
    for index, part in enumerate(parts):
        is_first, is_last = index == 0, index == len(parts) - 1
        ramps = (ramp if is_first and ends[0] else 0, ramp if is_last and ends[1] else 0)
        track = part.track(spec, step, ramps, (around[index], around[index + 1]))
        if before is not None:
            pieces.append(blended(before, track.frames(0, leads[index - 1])))
            windows.append((length, length + leads[index - 1]))
            length += leads[index - 1]
        own = track.frames(
            0 if is_first else leads[index - 1], len(track) if is_last else len(track) - 1 - leads[index]
        )
        pieces.append(own)
        length += len(own)
        before = None if is_last else track.frames(len(track) - 1 - leads[index], len(track) - 1)
    whole = Track(*(np.concatenate([getattr(piece, one.name) for piece in pieces]) for one in fields(Track)))
    for window in windows:
        whole = with_steps(whole, *window)
    return whole


def animal_of(poses: Poses, spec: RobotSpec, step: float) -> KeypointMotion:
    """Return the points of an animal of the robot's size that would ask for poses with feet."""
    assert poses.feet is not None
    along = to_rotation(poses.root_orientation).apply([TRUNK_HALF_LENGTH, 0.0, 0.0])
    trunk = np.stack([poses.root_position - along, poses.root_position + along], axis=1)
    hips = hip_joints(spec, poses.root_position, poses.root_orientation)
    toes = poses.feet - np.array([0.0, 0.0, spec.foot_radius])
    time = step * np.arange(len(poses), dtype=np.float64)
    return KeypointMotion(time, np.concatenate([trunk, hips, toes], axis=1))
