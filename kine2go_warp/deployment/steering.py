"""A reference that is steered: stitched from clips by speed and turn rate, while it is tracked.

Motion matching: a few times a second that frame of all clips is sought which goes on as commanded and whose pose is
nearest to the present one. The jump is faded out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from kine2go_warp.deployment.reference import Array, PlacedClip, Pose
from kine2go_warp.deployment.rotations import about_z, between, heading
from kine2go_warp.errors import ClipError
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.settings import check_ranges

SPEED_SCALE, TURN_SCALE = 0.15, 0.2
"""How far off a command counts as much as a scale of the pose [m/s, rad/s]."""
JOINT_SCALE, RATE_SCALE, HEIGHT_SCALE = 0.15, 0.03, 0.03
"""Scales of the differences between two poses [rad, rad in a frame, m]."""
LEAST_GAIN = 1.0
"""Gain, in squared scales, for which a jump is worth while."""


@dataclass(frozen=True)
class Command:
    """What is asked of the robot."""

    speed: float
    """Along the heading [m/s]."""
    turn: float
    """Turn rate, to the left [rad/s]."""


@dataclass(frozen=True)
class MatchingConfig:
    """Settings of the search for frames."""

    interval: float = 0.25
    """Time between two searches [s]."""
    fade: float = 0.3
    """Time over which a jump from one clip to another is faded out [s]."""
    look_ahead: float = 0.5
    """Time over which a clip's speed and turn rate are compared with the command [s]."""

    bend: float = 0.3
    """Largest turn rate that is added to a clip's own, for what is commanded and no clip has [rad/s]."""

    def __post_init__(self) -> None:
        check_ranges(self, interval=(0.02, 10), fade=(0.02, 10), look_ahead=(0.02, 10), bend=(0, 10))


@dataclass(frozen=True)
class Frames:
    """Frames of all clips at the control rate, each seen from its own heading."""

    joints: Array
    """[rad], shape [num_frames, 12]."""
    rates: Array
    """Change of the joints to the next frame [rad], shape [num_frames, 12]."""
    height: Array
    """Of the root [m], shape [num_frames]."""
    tilt: Array
    """Orientation of the root without its heading, rotation vector [rad], shape [num_frames, 3]."""
    step: Array
    """Way to the next frame: forward, to the left [m], turn [rad], shape [num_frames, 3]."""
    following: NDArray[np.int_]
    """Number of the next frame, shape [num_frames]."""
    speed: Array
    """Mean of the coming time [m/s], shape [num_frames]."""
    side_speed: Array
    """The same to the left [m/s], shape [num_frames]."""
    turn: Array
    """Mean of the coming time [rad/s], shape [num_frames]."""

    @classmethod
    def of(cls, clips: Sequence[MotionClip], rate: float, look_ahead: float) -> "Frames":
        """Cut one cycle of each clip into frames.

        Args:
            clips: Clips that are repeated.
            rate: Frames a second [Hz].
            look_ahead: Time over which speed and turn rate are averaged [s].

        Raises:
            ClipError: there is no clip that is repeated.
        """
        parts = [frames_of(clip, rate, round(look_ahead * rate)) for clip in clips if clip.cycle is not None]
        if not parts:
            raise ClipError("none of the clips is a cycle, and only these can be stitched")
        first = np.cumsum([0, *(len(part.height) for part in parts)])
        for number, part in enumerate(parts):
            part.following[:] += first[number]
        return cls(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(cls)))

    def unsuited(self, command: Command) -> Array:
        """Return how badly each frame suits a command, shape [num_frames]."""
        off = ((self.speed - command.speed) / SPEED_SCALE) ** 2 + (self.side_speed / SPEED_SCALE) ** 2
        return off + ((self.turn - command.turn) / TURN_SCALE) ** 2

    def nearest(self, place: int, joints: Array, rates: Array, height: float, command: Command) -> int:
        """Return the frame that suits a command and is nearest to a pose: the present one, unless another gains much.

        Args:
            place: The present frame.
            joints: Of the pose [rad], shape [12].
            rates: Their change in a frame [rad], shape [12].
            height: Of the root [m].
            command: What is asked.
        """
        cost = np.mean((self.joints - joints) ** 2, axis=1) / JOINT_SCALE**2
        cost += np.mean((self.rates - rates) ** 2, axis=1) / RATE_SCALE**2
        cost += ((self.height - height) / HEIGHT_SCALE) ** 2 + self.unsuited(command)
        best = int(np.argmin(cost))
        return best if cost[best] < cost[place] - LEAST_GAIN else place


def frames_of(clip: MotionClip, rate: float, ahead: int) -> Frames:
    """Return one cycle of a clip at about a rate, so that a whole number of frames makes the cycle."""
    count = max(2, round(clip.period * rate))
    placed = PlacedClip(clip, rate)
    places = np.arange(count + ahead + 1) * clip.period * rate / count
    roots = [placed.root(place) for place in places]
    yaw = np.unwrap([heading(root.rotation) for root in roots])
    position = np.array([root.position for root in roots])
    way = np.array([about_z(-turn) @ one for turn, one in zip(yaw[:-1], np.diff(position, axis=0), strict=True)])
    joints = np.array([placed.joint_position(place) for place in places[: count + 1]])
    level = [about_z(-turn) @ root.rotation for turn, root in zip(yaw, roots, strict=True)][:count]
    coming = np.arange(count)[:, None] + np.arange(ahead)
    return Frames(
        joints=joints[:-1],
        rates=np.diff(joints, axis=0),
        height=position[:count, 2],
        tilt=Rotation.from_matrix(level).as_rotvec(),
        step=np.column_stack([way[:, :2], np.diff(yaw)])[:count],
        following=(np.arange(count) + 1) % count,
        speed=rate * way[coming, 0].mean(axis=1),
        side_speed=rate * way[coming, 1].mean(axis=1),
        turn=rate * np.diff(yaw)[coming].mean(axis=1),
    )


class SteeredReference:
    """A reference that grows as it is steered. It begins at the origin, at the frame nearest to the first command."""

    def __init__(self, frames: Frames, rate: float, config: MatchingConfig, command: Command) -> None:
        self.frames, self.rate = frames, rate
        self.config, self.command, self.jumps = config, command, 0
        self._interval, self._fade = (max(1, round(span * rate)) for span in (config.interval, config.fade))
        self._place, self._since, self._bend = int(np.argmin(frames.unsuited(command))), self._fade, 0.0
        self._offset = self._pose(self._place) * 0.0
        self._roots = [self._root(np.zeros(2), 0.0, self._pose(self._place))]
        self._joints = [frames.joints[self._place]]

    def grow(self, steps: int) -> None:
        """Stitch until so many control steps are known."""
        while len(self._roots) <= steps:
            if len(self._roots) % self._interval == 0:
                self._search()
            pose = self._faded(self._place)
            last = self._roots[-1]
            turned = heading(last.rotation)
            forward, left, turn = pose[-3:]
            missing = self.command.turn - self.frames.turn[self._place]
            wanted = float(np.clip(missing, -self.config.bend, self.config.bend))
            self._bend += (wanted - self._bend) / self._fade
            turn += self._bend / self.rate
            ground = last.position[:2] + (about_z(turned) @ (forward, left, 0.0))[:2]
            self._place = int(self.frames.following[self._place])
            self._since += 1
            pose = self._faded(self._place)
            self._roots.append(self._root(ground, turned + turn, pose))
            self._joints.append(pose[:12])

    def root(self, step: float) -> Pose:
        """See ``Reference``."""
        one, fraction = self._split(step)
        before, after = self._roots[one], self._roots[one + 1]
        position = (1.0 - fraction) * before.position + fraction * after.position
        return Pose(position, between(before.rotation, after.rotation, fraction))

    def joint_position(self, step: float) -> Array:
        """See ``Reference``."""
        one, fraction = self._split(step)
        return (1.0 - fraction) * self._joints[one] + fraction * self._joints[one + 1]

    def joint_velocity(self, step: float) -> Array:
        """See ``Reference``."""
        one, _ = self._split(step)
        return 0.5 * self.rate * (self._joints[one + 1] - self._joints[max(one - 1, 0)])

    def _split(self, step: float) -> tuple[int, float]:
        """Return a whole step and the rest, after growing as far as is needed."""
        self.grow(int(step) + 2)
        return int(step), step - int(step)

    def _search(self) -> None:
        """Jump to a frame that suits the command better, if there is one."""
        pose = self._faded(self._place)
        rates = self._joint_rates()
        found = self.frames.nearest(self._place, pose[:12], rates, float(pose[12]), self.command)
        if found != self._place:
            self._offset, self._since = pose - self._pose(found), 0
            self._place, self.jumps = found, self.jumps + 1

    def _joint_rates(self) -> Array:
        """Return the last change of the joints [rad], shape [12]."""
        return self._joints[-1] - self._joints[-2] if len(self._joints) > 1 else np.zeros(12)

    def _pose(self, place: int) -> Array:
        """Return joints, height, tilt and way of a frame side by side, shape [19]."""
        frames = self.frames
        return np.concatenate([frames.joints[place], [frames.height[place]], frames.tilt[place], frames.step[place]])

    def _faded(self, place: int) -> Array:
        """Return a frame with what is left of the last jump."""
        left = max(0.0, 1.0 - self._since / self._fade)
        return self._pose(place) + left * left * (3.0 - 2.0 * left) * self._offset

    def _root(self, ground: Array, turned: float, pose: Array) -> Pose:
        """Return the root above a place, with the height and tilt of a frame."""
        rotation = about_z(turned) @ Rotation.from_rotvec(pose[13:16]).as_matrix()
        return Pose(np.array([ground[0], ground[1], pose[12]]), rotation)
