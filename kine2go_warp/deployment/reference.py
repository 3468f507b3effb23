"""A clip that is played on and on from a chosen place in the world, in NumPy."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.deployment.rotations import about_z, between, heading, to_matrix
from kine2go_warp.motions.clip import MotionClip

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Pose:
    """Where the reference root is."""

    position: Array
    """World frame [m], shape [3]."""
    rotation: Array
    """Base to world, shape [3, 3]."""


class PlacedClip:
    """The reference of one episode: every cycle begins where the last one has led."""

    def __init__(self, clip: MotionClip, control_rate: float) -> None:
        self.clip = clip
        self.frames_per_step = 1.0 / (control_rate * clip.frame_duration)
        self._rotations = [to_matrix(orientation) for orientation in clip.root_orientation]
        self._cycles: list[Pose] = []
        self.start_frame = 0.0
        self.place(0.0, (0.0, 0.0), 0.0)

    def place(self, phase: float, ground: tuple[float, float], turn: float) -> None:
        """Choose where the episode begins.

        Args:
            phase: Place in the cycle, in [0, 1).
            ground: Where the reference root stands at the beginning [m].
            turn: By how much the whole clip is turned about the vertical axis [rad].
        """
        self.start_frame = phase * self.clip.num_frames
        self._cycles = [Pose(np.zeros(3), about_z(turn))]
        beginning = self.root(0.0).position
        self._cycles = [Pose(np.array([ground[0] - beginning[0], ground[1] - beginning[1], 0.0]), about_z(turn))]

    def phase(self, step: float) -> float:
        """Return the place in the cycle ``step`` control steps into the episode, in [0, 1)."""
        return (self._frame(step) / self.clip.num_frames) % 1.0

    def root(self, step: float) -> Pose:
        """Return the root ``step`` control steps into the episode."""
        whole, fraction = self._split(step)
        one, other = self._whole_frame(whole), self._whole_frame(whole + 1)
        position = (1.0 - fraction) * one.position + fraction * other.position
        return Pose(position, between(one.rotation, other.rotation, fraction))

    def joint_position(self, step: float) -> Array:
        """Return the joint positions [rad], shape [12]."""
        return self._joints(self.clip.joint_position, step)

    def joint_velocity(self, step: float) -> Array:
        """Return the joint velocities [rad/s], shape [12]."""
        return self._joints(self.clip.joint_velocity, step)

    def _joints(self, values: NDArray[Any], step: float) -> Array:
        """Interpolate between two frames; a cycle ends where it began."""
        whole, fraction = self._split(step)
        count = self.clip.num_frames
        return (1.0 - fraction) * values[whole % count] + fraction * values[(whole + 1) % count]

    def _frame(self, step: float) -> float:
        """Return the place in the clip [frames], which grows without bound."""
        return self.start_frame + step * self.frames_per_step

    def _split(self, step: float) -> tuple[int, float]:
        """Return whole frames and the rest."""
        frame = self._frame(step)
        whole = int(np.floor(frame))
        return whole, frame - whole

    def _whole_frame(self, frame: int) -> Pose:
        """Return the root at a whole frame, placed in the world."""
        cycle, index = divmod(frame, self.clip.num_frames)
        frame_of_cycle = self._cycle(cycle)
        position = frame_of_cycle.position + frame_of_cycle.rotation @ self.clip.root_position[index]
        return Pose(position, frame_of_cycle.rotation @ self._rotations[index])

    def _cycle(self, number: int) -> Pose:
        """Return where a cycle's own origin lies: each is moved on from the one before by the displacement."""
        step = self.clip.cycle
        while len(self._cycles) <= number:
            last = self._cycles[-1]
            position = last.position + last.rotation @ np.array([step.x, step.y, 0.0])
            self._cycles.append(Pose(position, about_z(heading(last.rotation) + step.yaw)))
        return self._cycles[number]
