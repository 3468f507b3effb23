"""Settings of a benchmark."""

import math
from dataclasses import dataclass
from typing import Literal

from kine2go_warp.settings import check_ranges


@dataclass(frozen=True)
class BenchmarkConfig:
    """Settings of a benchmark. Results under other settings, or of another version, cannot be compared."""

    trajectories: int = 20
    """Rollouts of each motion under each condition; the first ones of the dataset."""
    engine: Literal["newton", "mujoco"] = "newton"
    """``newton``: the simulation that the data come from; ``mujoco``: plain MuJoCo, which tells no slip."""
    kick: float = 0.5
    """Velocity in a random direction of the plane that the perturbed bases begin with, on top of the recorded [m/s]."""
    max_distance: float = 1.0
    """A robot farther from its reference than this is lost [m]."""
    max_angle: float = 1.0
    """So is one that is turned from it by more than this [rad]."""
    seed: int = 1
    """Of the kicks."""

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            Kine2GoError: a value is outside.
        """
        check_ranges(self, trajectories=(1, 1_000_000), kick=(0, 10), seed=(0, 2**31 - 1))
        check_ranges(self, max_distance=(1e-3, 1e3), max_angle=(1e-3, math.pi))
