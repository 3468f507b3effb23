"""Settings of the retargeting stage."""

from dataclasses import dataclass
from typing import Literal

from kine2go_warp.settings import check_ranges

Mode = Literal["contact", "plain"]
TimeScale = float | Literal["froude"]

CYCLE_TIMES = (0.35, 3.0)
"""Shortest and longest cycle that is looked for [s]."""
LEAST_WAY = 0.1
"""Of the robot in such a cycle [m], to leave out standing still."""


@dataclass(frozen=True)
class RetargetConfig:
    """Settings of the retargeting stage."""

    mode: Mode = "contact"
    """``contact``: standing feet are held in place, nothing is below the floor, legs keep off their limits.
    ``plain``: the paper's frame-wise rule."""
    search_time: float = 0.35
    """How far the ends of a range may move to find the best seam [s], a sixth of the range at most; 0 keeps it."""
    blend_time: float = 0.25
    """Time on either side of a cycle's seam over which it is blended [s]."""
    hold: float = 0.5
    """Time for which the first and the last pose of a motion that is played once are held [s]."""
    slow_down_time: float = 0.5
    """Time over which such a motion comes from rest, and to rest again, along the animal's own way [s]."""
    smoothing: float = 0.02
    """Standard deviation of the filter on the base's motion [s]."""
    stance_height: float = 0.25
    """A foot lower than this share of its swings nearby may stand; it is lifted when it exceeds twice as much."""
    stance_speed: float = 0.2
    """A foot slower than this share of its swings nearby may stand; it is lifted at 1.4 times that."""
    swing_clearance: float = 0.015
    """Least height of a foot in the middle of a swing [m], or the animal's own where that is lower."""
    knee_margin: float = 0.06
    """How far knees keep off their limits [rad]."""
    time_scale: TimeScale = 1.0
    """Duration of the motion over the animal's. ``froude``: the square root of the size of the robot over the animal's,
    at which bodies of both sizes fall alike; flights then follow a parabola."""

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            Kine2GoError: a value is outside.
        """
        check_ranges(self, search_time=(0, 10), blend_time=(0, 10), hold=(0, 60), slow_down_time=(0, 10))
        check_ranges(self, smoothing=(0, 1), stance_height=(0, 1))
        check_ranges(self, stance_speed=(0, 1), swing_clearance=(0, 0.2), knee_margin=(0, 0.5))
        if self.time_scale != "froude":
            check_ranges(self, time_scale=(0.1, 10))
