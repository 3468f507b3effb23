"""Settings of an evaluation."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.terms.randomization import RANDOMIZATION
from kine2go_warp.learning.presets import ROBUST
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.rollouts.config import MILD, rollout_environment
from kine2go_warp.settings import check_ranges

GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
"""Multiples of it fill a circle evenly, whatever their number, and are not correlated with the phases."""

RANDOMIZATIONS = {"mild": MILD, "robust": ROBUST.env.randomization}
"""Named ranges: those of gathering, and those that the preset ``robust`` trains with."""


@dataclass(frozen=True)
class EvalConfig:
    """Settings of an evaluation."""

    worlds: int = 64
    """Rollouts of each clip under each condition; their headings are evenly spaced."""
    start: Literal["phases", "first_frame"] = "phases"
    """Where in a clip rollouts begin: ``phases``, evenly spaced over the cycle, or all at its first frame, where those
    of a clip that is played once always begin."""
    stochastic: bool = True
    """Whether to evaluate also with the policy's noise on its actions."""
    randomised: bool = True
    """Whether to evaluate also in worlds that differ, with pushes."""
    seconds: float = 20.0
    """Length of a rollout [s]; one of a clip that is played once ends with the clip."""
    randomization: Literal["mild", "robust"] = "mild"
    """What differs between rollouts where something does: mild as in gathering, robust as in that preset."""
    max_distance: float = 1.0
    """A rollout ends when the root is farther than this from its reference [m]."""
    max_angle: float = 1.5708
    """A rollout ends when the root is turned from its reference by more than this [rad]."""
    seed: int = 1

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            Kine2GoError: a value is outside.
        """
        check_ranges(self, worlds=(1, 1_000_000), seconds=(0.1, 3600), seed=(0, 2**31 - 1))
        check_ranges(self, max_distance=(1e-6, 1e3), max_angle=(1e-6, np.pi))

    def rows(self, control_rate: float, clip: MotionClip) -> int:
        """Return the length of a rollout [control steps]."""
        longest = round(self.seconds * control_rate)
        return longest if clip.cycle is not None else min(longest, math.ceil(clip.period * control_rate - 1e-6) + 1)

    def environment(self, trained: EnvConfig, randomised: bool, num_worlds: int) -> EnvConfig:
        """Return the environment to evaluate in: that of the training, with the same limits for every policy."""
        limits = (self.max_distance, self.max_angle)
        randomization = RANDOMIZATIONS[self.randomization] if randomised else RANDOMIZATION
        return rollout_environment(trained, num_worlds, self.seed, self.seconds + 1.0, limits, randomization)

    def initial_phases(self, clip: MotionClip) -> np.ndarray:
        """Return the initial phases, the middles of equal parts of a cycle or its beginning, shape [worlds]."""
        if clip.cycle is None or self.start == "first_frame":
            return np.zeros(self.worlds, dtype=np.float32)
        return ((np.arange(self.worlds) + 0.5) / self.worlds).astype(np.float32)

    def initial_headings(self) -> np.ndarray:
        """Return the initial headings, evenly spaced [rad], shape [worlds]."""
        turns = (np.arange(self.worlds) * GOLDEN) % 1.0
        return (2.0 * np.pi * turns - np.pi).astype(np.float32)
