"""Settings of the retargeting stage."""

from dataclasses import dataclass


@dataclass(frozen=True)
class RetargetConfig:
    """Settings of the retargeting stage."""

    blend_frames: int = 8
    """Frames on either side of a cycle's seam over which it is blended."""
