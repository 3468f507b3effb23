"""The ground as a field of heights."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from kine2go_warp.env.config import EnvConfig, TerrainConfig
from kine2go_warp.kernels.terrain import Terrain
from kine2go_warp.motions.clip import MotionClip

BODY_LENGTH = 0.4
"""Distance between front and hind feet [m]: the reference is lifted by the ground smoothed over this length."""

MARGIN = 2.0
"""Ground beyond the farthest place that a reference reaches [m]."""


@dataclass(frozen=True)
class HeightField:
    """A square of ground about the world's origin."""

    height: NDArray[np.float32]
    """Height of the ground [m], shape [num_points, num_points], first index along y."""
    lift: NDArray[np.float32]
    """How far a reference is lifted [m], same shape."""
    half_extent: float
    """Half the length of a side [m]."""

    def upload(self, device: wp.Device) -> Terrain:  # pyright: ignore[reportGeneralTypeIssues] - a Warp struct
        """Copy the field to a device."""
        terrain = Terrain()
        terrain.height = wp.array(self.height, dtype=float, device=device)
        terrain.lift = wp.array(self.lift, dtype=float, device=device)
        terrain.half_extent = self.half_extent
        return terrain


FLAT = HeightField(np.zeros((2, 2), np.float32), np.zeros((2, 2), np.float32), 1.0)
"""Level ground at height zero."""


def build_height_field(config: TerrainConfig, reach: float) -> HeightField:
    """Return the ground.

    Args:
        config: What kind of ground.
        reach: How far from the middle a robot may come [m].
    """
    if config.is_flat:
        return FLAT
    points = 2 * int(np.ceil((reach + MARGIN) / config.spacing)) + 1
    half_extent = 0.5 * (points - 1) * config.spacing
    place = np.linspace(-half_extent, half_extent, points)
    x, y = np.meshgrid(place, place)
    height = SHAPES[config.kind](config, x, y)
    lift = gaussian_filter(height, 0.5 * BODY_LENGTH / config.spacing, mode="nearest")
    return HeightField(height.astype(np.float32), lift.astype(np.float32), half_extent)


def waves(config: TerrainConfig, x: NDArray[Any], y: NDArray[Any]) -> NDArray[Any]:
    """Return the sum of two crossing sine waves [m]."""
    turns = 2.0 * np.pi / config.length
    return 0.25 * config.height * (np.sin(turns * x) + np.sin(turns * y))


def steps(config: TerrainConfig, x: NDArray[Any], y: NDArray[Any]) -> NDArray[Any]:
    """Return square plateaus of random heights [m]."""
    column = np.floor((x - x.min()) / config.length).astype(int)
    row = np.floor((y - y.min()) / config.length).astype(int)
    rng = np.random.default_rng(config.seed)
    plateaus = rng.uniform(-0.5, 0.5, (row.max() + 1, column.max() + 1))
    return config.height * plateaus[row, column]


def slopes(config: TerrainConfig, x: NDArray[Any], y: NDArray[Any]) -> NDArray[Any]:
    """Return ridges along y, whose flanks rise and fall evenly [m]."""
    flank = np.abs((x / config.length) % 1.0 - 0.5)
    return config.height * (0.5 - 2.0 * flank) + 0.0 * y


SHAPES = {"waves": waves, "steps": steps, "slopes": slopes}
"""Height of each kind of ground at given places."""


def terrain_extent(clips: Sequence[MotionClip], config: EnvConfig) -> float:
    """Return how far from the middle of the ground a reference may come in an episode [m]."""
    speeds = [np.hypot(clip.cycle.x, clip.cycle.y) / clip.period for clip in clips if clip.cycle is not None]
    # Within a cycle a reference may stray from the straight line; a clip played once goes no farther than this.
    wobble = max(float(np.ptp(clip.root_position[:, :2], axis=0).max()) for clip in clips)
    return float(np.sqrt(2.0) * config.terrain.spread + max(speeds, default=0.0) * config.episode_time + wobble)
