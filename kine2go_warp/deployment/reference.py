"""A clip that is played from a chosen place in the world, on and on or once, in NumPy."""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.deployment.rotations import about_z, between, heading, to_matrix
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.motions.cycle import CycleStep, continued

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Pose:
    """Where the reference root is."""

    position: Array
    """World frame [m], shape [3]."""
    rotation: Array
    """Base to world, shape [3, 3]."""


class Reference(Protocol):
    """What is tracked, by control steps since the episode began; they need not be whole."""

    def root(self, step: float) -> Pose:
        """Return the root."""
        ...

    def joint_position(self, step: float) -> Array:
        """Return the joint positions [rad], shape [12]."""
        ...

    def joint_velocity(self, step: float) -> Array:
        """Return the joint velocities [rad/s], shape [12]."""
        ...


class PlacedClip:
    """The reference of one episode: cycles begin where the last one has led; a clip played once stays at its end."""

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
            phase: Place in the clip, in [0, 1).
            ground: Where the reference root stands at the beginning [m].
            turn: By how much the whole clip is turned about the vertical axis [rad].
        """
        self.start_frame = phase * self.clip.span
        self._cycles = [Pose(np.zeros(3), about_z(turn))]
        beginning = self.root(0.0).position
        self._cycles = [Pose(np.array([ground[0] - beginning[0], ground[1] - beginning[1], 0.0]), about_z(turn))]

    def phase(self, step: float) -> float:
        """Return the place in the clip ``step`` control steps into the episode: in [0, 1), or up to 1 at an end."""
        turns = self._frame(step) / self.clip.span
        return turns if self.clip.cycle is None else turns % 1.0

    def body_may_touch(self, step: float) -> bool:
        """Return whether parts other than the feet may touch the ground ``step`` control steps into the episode."""
        whole, _ = self._split(step)
        return bool(
            self.clip.body_may_touch[continued(np.array(whole), self.clip.num_frames, self.clip.cycle is not None)]
        )

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
        one, other = continued(np.array([whole, whole + 1]), self.clip.num_frames, self.clip.cycle is not None)
        return (1.0 - fraction) * values[one] + fraction * values[other]

    def _frame(self, step: float) -> float:
        """Return the place in the clip [frames]: it grows without bound, but for a clip played once."""
        frame = self.start_frame + step * self.frames_per_step
        return frame if self.clip.cycle is not None else min(max(frame, 0.0), float(self.clip.span))

    def _split(self, step: float) -> tuple[int, float]:
        """Return whole frames and the rest."""
        frame = self._frame(step)
        whole = int(np.floor(frame))
        return whole, frame - whole

    def _whole_frame(self, frame: int) -> Pose:
        """Return the root at a whole frame, placed in the world."""
        index = int(continued(np.array(frame), self.clip.num_frames, self.clip.cycle is not None))
        cycle = (frame - index) // self.clip.num_frames if self.clip.cycle is not None else 0
        frame_of_cycle = self._cycle(cycle)
        position = frame_of_cycle.position + frame_of_cycle.rotation @ self.clip.root_position[index]
        return Pose(position, frame_of_cycle.rotation @ self._rotations[index])

    def _cycle(self, number: int) -> Pose:
        """Return where a cycle's own origin lies: each is moved on from the one before by the displacement."""
        step = self.clip.cycle or CycleStep(0.0, 0.0, 0.0)
        while len(self._cycles) <= number:
            last = self._cycles[-1]
            position = last.position + last.rotation @ np.array([step.x, step.y, 0.0])
            self._cycles.append(Pose(position, about_z(heading(last.rotation) + step.yaw)))
        return self._cycles[number]
