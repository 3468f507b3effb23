"""What every source delivers: named points of an animal in metres, z up, with true time stamps."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.cycle import rest_places
from kine2go_warp.quantities import LEG_NAMES
from kine2go_warp.tables import counted

KEYPOINTS = ("pelvis", "neck", *(f"{leg}_hip" for leg in LEG_NAMES), *(f"{leg}_toe" for leg in LEG_NAMES))
"""The points that retargeting needs, in the order of ``KeypointMotion.position``."""

BONES = tuple(
    (KEYPOINTS.index(first), KEYPOINTS.index(second))
    for first, second in (
        ("pelvis", "neck"),
        *(("neck" if leg[0] == "F" else "pelvis", f"{leg}_hip") for leg in LEG_NAMES),
        *((f"{leg}_hip", f"{leg}_toe") for leg in LEG_NAMES),
    )
)
"""Which points to join by lines when they are drawn, by their places in ``KEYPOINTS``."""

RATES = (1.0, 1000.0)
"""Lowest and highest frame rate of a motion [Hz]."""
MINIMUM_FRAMES = 3
"""Central differences and a cycle need at least this many frames."""


@dataclass(frozen=True)
class KeypointMotion:
    """Trajectories of the ten keypoints of a four-legged animal."""

    time: NDArray[np.float64]
    """Time stamps [s], shape [num_frames], evenly spaced."""
    position: NDArray[np.float64]
    """Positions in the ``KEYPOINTS`` order [m], z up, shape [num_frames, 10, 3]."""
    remarks: tuple[str, ...] = ()
    """What was repaired in the file."""
    notes: tuple[str, ...] = ()
    """What the file was taken for."""
    foot_radius: float = float("nan")
    """Of the balls whose centres the toes are [m]; NaN for an animal."""
    slowest_jump: float = 0.0
    """A point that comes or goes more slowly than this has moved and not jumped [m/s]."""

    def __post_init__(self) -> None:
        if self.position.shape != (len(self.time), len(KEYPOINTS), 3):
            raise ClipError(f"keypoints have shape {self.position.shape}, not ({len(self.time)}, {len(KEYPOINTS)}, 3)")

    @property
    def num_frames(self) -> int:
        """Number of frames."""
        return len(self.time)

    @property
    def rate(self) -> float:
        """Frames per second [Hz]."""
        return (self.num_frames - 1) / float(self.time[-1] - self.time[0])

    @property
    def trunk_length(self) -> float:
        """Median distance from pelvis to neck over the frames that have both [m]."""
        length = np.linalg.norm(self.point("neck") - self.point("pelvis"), axis=1)
        known = length[np.isfinite(length)]
        return float(np.median(known)) if len(known) else 0.0

    def point(self, name: str) -> NDArray[np.float64]:
        """Return one keypoint's trajectory [m], shape [num_frames, 3]."""
        return self.position[:, KEYPOINTS.index(name)]

    def points(self, kind: str) -> NDArray[np.float64]:
        """Return ``hip`` or ``toe`` of all legs (FL, FR, RL, RR) [m], shape [num_frames, 4, 3]."""
        return np.stack([self.point(f"{leg}_{kind}") for leg in LEG_NAMES], axis=1)

    def frames(self, start: int, stop: int) -> "KeypointMotion":
        """Return the frames ``start`` to ``stop`` (exclusive)."""
        return replace(self, time=self.time[start:stop], position=self.position[start:stop])

    def played_once(self, start: int, end: int, hold: float, slow_down: float, margin: float) -> "KeypointMotion":
        """Return a range that comes from rest and to rest, between poses that are held.

        The points stay on their ways. Only the time at which they pass changes: the speed of the range rises from
        nothing within ``slow_down`` and falls to nothing again, without a jump of speed or acceleration.

        Args:
            start: First frame of the range.
            end: The frame after its last.
            hold: Time for which the first and the last pose are held [s].
            slow_down: Time of each change of speed [s]; at most the time that the range has.
            margin: Time by which they are held longer, to have something beyond the ends [s].
        """
        step, last = 1.0 / self.rate, end - 1 - start
        ramp = 2 * min(round(0.5 * slow_down / step), last // 2)
        held = round(hold / step) + round(margin / step)
        places = np.clip(rest_places(last, (ramp, ramp), held, held), 0.0, last)
        position = CubicSpline(np.arange(last + 1), self.position[start:end])(places)
        return replace(self, time=step * np.arange(len(places)), position=position)

    def scaled(self, factor: float) -> "KeypointMotion":
        """Return the motion of an animal ``factor`` times as large."""
        return replace(self, position=self.position * factor, foot_radius=self.foot_radius * factor)


@dataclass(frozen=True)
class FrameRange:
    """A range of frames as in Python slices; an ``end`` of -1 means up to and including the last frame."""

    start: int = 0
    end: int = -1

    def resolve(self, num_frames: int, where: str) -> tuple[int, int]:
        """Return start and exclusive end for a clip of ``num_frames``.

        Raises:
            ClipError: the range leaves the clip or holds too few frames.
        """
        end = num_frames if self.end == -1 else self.end
        if not 0 <= self.start < end <= num_frames:
            raise ClipError(
                f"{where}: frames {self.start} to {self.end} are not within its {num_frames} frames; "
                f"choose 0 <= start < end <= {num_frames} (or end = -1)"
            )
        if end - self.start < MINIMUM_FRAMES:
            raise ClipError(
                f"{where}: {counted(end - self.start, 'frame')} selected; a motion needs at least {MINIMUM_FRAMES}"
            )
        return self.start, end
