"""Settings of the retargeting stage."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class RetargetConfig:
    """Settings of the retargeting stage."""

    mode: Literal["contact", "plain"] = "contact"
    """``contact``: standing feet are held in place, nothing is below the floor, legs keep off their limits.
    ``plain``: the paper's frame-wise rule."""
    blend_frames: int = 12
    """Frames on either side of a cycle's seam over which it is blended."""
    search_frames: int = 15
    """How far the ends of a range may move to find the best seam [frames], a sixth of the range at most; 0 keeps it."""
    smoothing: float = 0.02
    """Standard deviation of the filter on the base's motion [s]."""
    stance_height: float = 0.02
    """A foot below this height may stand [m]; it is lifted when it exceeds twice as much."""
    stance_speed: float = 0.4
    """A foot slower than this, plus a quarter of the base's speed, may stand [m/s]; it is lifted at 1.6 times that."""
    swing_clearance: float = 0.015
    """Least height of a foot in the middle of a swing [m]."""
    knee_margin: float = 0.06
    """How far knees keep off their limits [rad]."""
