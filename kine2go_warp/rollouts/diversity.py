"""What makes rollouts differ on purpose, so that their states cover more than the cycle of the clip."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.errors import DatasetError
from kine2go_warp.motions.variation import Variation
from kine2go_warp.settings import check_ranges

Range = tuple[float, float]
"""Least and greatest value of something that is drawn uniformly for each rollout."""


@dataclass(frozen=True)
class DiversitySettings:
    """How rollouts differ. What is not given is that of the level; each value is drawn for each rollout."""

    level: Literal["paper", "cloning", "wide"] = "paper"
    """``paper``: one reference, tracked from near it. ``cloning``: the way back to it as well, for policies that learn
    from the data. ``wide``: also other paces, speeds and turns."""
    time_scale: Range | None = None
    """Duration of the reference over its clip's."""
    mirrored: float | None = None
    """Share of rollouts whose reference is the clip's mirror image."""
    speed_offset: Range | None = None
    """Added to the speed of the reference, along its heading [m/s]."""
    turn_offset: Range | None = None
    """Added to the yaw rate of the reference [rad/s]."""
    noise_time: Range | None = None
    """Correlation time of the noise on the actions [s]; 0 draws it anew in every row."""
    recovery: float | None = None
    """Share of rollouts whose rows begin off the reference, without the warm-up."""
    reset_scale: Range | None = None
    """How far off these begin, as a multiple of the spread of other first states."""
    hard_push_speed: Range | None = None
    """Speed of pushes [m/s], instead of what [gather.randomization] says."""
    recovery_time: float | None = None
    """Time after such a beginning or a hard push for which the limits of tracking do not count [s]."""
    recovery_limit_scale: float | None = None
    """Distance and angle that are allowed within that time, as a multiple of their limits."""

    def __post_init__(self) -> None:
        check_ranges(
            self,
            time_scale=(0.5, 2.0),
            mirrored=(0, 1),
            speed_offset=(-2, 2),
            turn_offset=(-3, 3),
            noise_time=(0, 2),
            recovery=(0, 1),
            reset_scale=(1, 20),
            hard_push_speed=(0, 5),
            recovery_time=(0, 60),
            recovery_limit_scale=(1, 10),
        )
        for name, value in vars(self).items():
            if isinstance(value, tuple) and value[0] > value[1]:
                raise DatasetError(f"{name} is {list(value)}; the first must not be above the second")

    def resolved(self) -> "DiversitySettings":
        """Return the settings with the values of the level where none are given."""
        return replace(LEVELS[self.level], **{name: value for name, value in vars(self).items() if value is not None})

    @property
    def varies_reference(self) -> bool:
        """Whether references differ from their clip; of settings that are resolved."""
        return tuple(getattr(self, one.name) for one in fields(Variation)) != UNVARIED

    @property
    def fastest(self) -> Variation:
        """The reference that goes farthest; of settings that are resolved."""
        assert self.time_scale is not None
        assert self.speed_offset is not None
        return Variation(self.time_scale[0], speed_offset=max(self.speed_offset[1], 0.0))

    def draw(self, rng: np.random.Generator, count: int) -> dict[str, NDArray[Any]]:
        """Draw for a number of rollouts; settings must be resolved.

        Returns:
            Arrays by their names in ``DIVERSITY_ARRAYS`` of the dataset, each of shape [count].
        """

        def ranged(name: str) -> NDArray[Any]:
            least, greatest = getattr(self, name)
            return (least + (greatest - least) * rng.random(count)).astype(np.float32)

        drawn = {name: ranged(name) for name in ("time_scale", "speed_offset", "turn_offset", "noise_time")}
        spread = ranged("reset_scale")
        for name in ("mirrored", "recovery"):
            drawn[name] = (rng.random(count) < (getattr(self, name) or 0.0)).astype(np.int32)
        drawn["reset_scale"] = np.where(drawn["recovery"] > 0, spread, np.float32(1.0))
        return drawn


LEVELS = {
    "paper": DiversitySettings(
        "paper", time_scale=(1.0, 1.0), mirrored=0.0, speed_offset=(0.0, 0.0), turn_offset=(0.0, 0.0),
        noise_time=(0.0, 0.0), recovery=0.0, reset_scale=(1.0, 1.0), recovery_time=0.0, recovery_limit_scale=1.0,
    ),
    "cloning": DiversitySettings(
        "cloning", time_scale=(1.0, 1.0), mirrored=0.0, speed_offset=(0.0, 0.0), turn_offset=(0.0, 0.0),
        noise_time=(0.0, 0.1), recovery=0.3, reset_scale=(2.0, 6.0), hard_push_speed=(0.0, 0.6), recovery_time=1.5,
        recovery_limit_scale=1.5,
    ),
    "wide": DiversitySettings(
        "wide", time_scale=(0.85, 1.15), mirrored=0.5, speed_offset=(-0.1, 0.1), turn_offset=(-0.2, 0.2),
        noise_time=(0.0, 0.1), recovery=0.3, reset_scale=(2.0, 6.0), hard_push_speed=(0.0, 0.8), recovery_time=1.5,
        recovery_limit_scale=1.5,
    ),
}  # fmt: skip
"""Values of each level; no ``hard_push_speed`` leaves that of [gather.randomization]."""

UNVARIED = tuple(getattr(LEVELS["paper"], one.name) for one in fields(Variation))


def variations(drawn: Mapping[str, NDArray[Any]]) -> list[Variation]:
    """Return how the reference of each rollout differs from its clip."""
    columns = [drawn[one.name].tolist() for one in fields(Variation)]
    return [Variation(scale, bool(mirror), speed, turn) for scale, mirror, speed, turn in zip(*columns, strict=True)]
