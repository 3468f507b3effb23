"""When each foot stands, and holding it in place while it does."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from kine2go_warp.motions.config import RetargetConfig

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SHORTEST_STANCE = 0.05
"""A foot that stands for less is taken to swing on [s]."""
SHORTEST_SWING = 0.04
"""A foot that is lifted for less is taken to stand on [s]."""
NEARBY = 0.5
"""Height and speed of a foot's own swings are looked for this far on either side [s]."""
LOWEST_SWING, SLOWEST_SWING = 0.01, 0.3
"""A swing is taken to be at least this high [m] and this fast [m/s], so that noise of a standing foot is none."""
FADE = 0.2
"""Share of a swing within which heights give way to the floor after lift-off and before touch-down."""
PROJECTIONS = 40
"""How often a foothold is moved into reach of the frame that lacks most."""
LONGEST_RELEASE = 0.3
"""A foot out of reach may stand this share less, at either end of its stance together."""


@dataclass(frozen=True)
class Interval:
    """Frames ``first`` to ``last``, both included."""

    first: int
    last: int

    @property
    def frames(self) -> slice:
        """The frames as a slice."""
        return slice(self.first, self.last + 1)


@dataclass(frozen=True)
class Reach:
    """How far the legs reach at each frame."""

    hips: Array
    """Hip joints [m], shape [num_frames, 4, 3]."""
    farthest: float
    """From a hip joint to the centre of its foot [m]."""
    foot_radius: float
    """[m]"""
    give: float = 0.0
    """How far the base may be pulled down for a foot to reach [m]."""

    def radius(self, foot: int, height: Array) -> Array:
        """Return how far from below its hip a foot can be when its sphere is at some heights over the floor [m]."""
        above = self.hips[:, foot, 2] - height - self.foot_radius
        return np.sqrt(np.maximum(self.farthest**2 - above**2, 0.0))


def detect_stance(feet: Array, frame_duration: float, config: RetargetConfig) -> Mask:
    """Return whether each foot stands, shape [num_frames, 4].

    A foot comes to stand when it is low and slow against its own swings nearby, and leaves the floor when it is clearly
    no longer either; the gap between the two sets of thresholds keeps noise from toggling it.

    Args:
        feet: Heights over the standing height and planar positions [m], shape [num_frames, 4, 3].
        frame_duration: [s]
        config: Thresholds.
    """
    size = 2 * round(NEARBY / frame_duration) + 1
    velocity = np.gradient(feet, frame_duration, axis=0)
    speed = np.linalg.norm(velocity[..., :2], axis=-1)
    height = feet[..., 2]
    fast = config.stance_speed * np.maximum(maximum_filter1d(speed, size, axis=0, mode="nearest"), SLOWEST_SWING)
    high = config.stance_height * np.maximum(maximum_filter1d(height, size, axis=0, mode="nearest"), LOWEST_SWING)
    # A toe that rests on its tip or on a rise is higher than others, but moves in no direction.
    rests = (height < 2.5 * high) & (np.linalg.norm(velocity, axis=-1) < 0.5 * fast)
    enters = ((height < high) & (speed < fast)) | rests
    leaves = ((height > 2.0 * high) | (speed > 1.4 * fast)) & ~rests
    stance = np.empty(enters.shape, dtype=bool)
    standing = enters[0]
    for frame in range(len(feet)):
        standing = (standing | enters[frame]) & ~leaves[frame]
        stance[frame] = standing
    return without_short_runs(stance, frame_duration)


def without_short_runs(stance: Mask, frame_duration: float) -> Mask:
    """Return the same without swings and stances that are too short to be any, but for those at the ends."""
    stance = stance.copy()
    for foot in range(4):
        _drop_short(stance[:, foot], False, SHORTEST_SWING / frame_duration)
        _drop_short(stance[:, foot], True, SHORTEST_STANCE / frame_duration)
    return stance


def intervals(mask: Mask) -> list[Interval]:
    """Return the runs of true values."""
    padded = np.zeros(len(mask) + 2, dtype=bool)
    padded[1:-1] = mask
    edges = np.flatnonzero(padded[1:] != padded[:-1]).tolist()
    return [Interval(first, end - 1) for first, end in zip(edges[::2], edges[1::2], strict=True)]


def hold_feet(
    feet: Array, stance: Mask, rolling: Array, reach: Reach, config: RetargetConfig
) -> tuple[Array, Mask, Array]:
    """Return feet that stand where they stand and swing from one foothold to the next, and which of them stand.

    The third result is by how far feet are moved for their legs to reach them [m], shape [num_frames, 4].

    Standing feet roll without slipping. A foothold that a leg cannot reach during all of the stance is moved as little
    as possible; if that is not enough, the foot is lifted earlier or put down later.

    Args:
        feet: Heights over the standing height and planar positions [m], shape [num_frames, 4, 3].
        stance: Whether each foot stands, shape [num_frames, 4].
        rolling: How far the centres of the feet have rolled since the first frame [m], shape [num_frames, 4, 2].
        reach: How far the legs reach.
        config: Settings.
    """
    held, kept, moved = stand_feet(feet, stance, rolling, reach)
    for foot in range(feet.shape[1]):
        path, raw, runs = held[:, foot], feet[:, foot], intervals(kept[:, foot])
        # The animal's foot is at its own height where the robot's is on the floor.
        low = [median(raw[run.frames, 2]) for run in intervals(stance[:, foot])]
        for index in range(len(runs) - 1):
            swing = slice(runs[index].last, runs[index + 1].first + 1)
            _bridge(path[swing], raw[swing], low[index : index + 2], config.swing_clearance)
        if runs:
            # Before the first and after the last stance the foothold's correction simply goes on.
            first, last = runs[0].first, runs[-1].last
            path[:first] = raw[:first] + (path[first] - raw[first])
            path[last + 1 :] = raw[last + 1 :] + (path[last] - raw[last])
        path[:, 2] = np.maximum(path[:, 2], 0.0)
        under_hip = reach.hips[:, foot, :2]
        moved[:, foot] += _pull_in(path, kept[:, foot], under_hip, reach.radius(foot, path[:, 2]))
    return held, kept, moved


def stand_feet(feet: Array, stance: Mask, rolling: Array, reach: Reach) -> tuple[Array, Mask, Array]:
    """Return feet with those that stand on their footholds, as ``hold_feet`` does, which sees to the swings, too."""
    held, kept, moved = feet.copy(), np.zeros_like(stance), np.zeros(stance.shape)
    for foot in range(feet.shape[1]):
        path, roll, under_hip = held[:, foot], rolling[:, foot], reach.hips[:, foot, :2]
        radius = reach.radius(foot, np.full(len(feet), -reach.give))
        for run in intervals(stance[:, foot]):
            rolled = roll[run.frames]
            wanted = median(path[run.frames, :2] - rolled)
            foothold, first, last = _within_reach(wanted, under_hip[run.frames] - rolled, radius[run.frames])
            moved[run.frames, foot] = math.hypot(*(foothold - wanted))
            stands = slice(run.first + first, run.first + last + 1)
            kept[stands, foot] = True
            path[stands, :2], path[stands, 2] = foothold + roll[stands], 0.0
    return held, kept, moved


def _within_reach(foothold: Array, under_hip: Array, radius: Array) -> tuple[Array, int, int]:
    """Return the foothold next to the one given that is in reach of all places; then the first and last that reach it.

    Repeated projection onto the disc that is farthest away finds the nearest common point of discs, near enough.
    """
    foothold = foothold.copy()
    first, last = 0, len(under_hip) - 1
    for _ in range(PROJECTIONS):
        offset = foothold - under_hip
        distance = np.hypot(*offset.T)
        lack = distance - radius
        worst = int(np.argmax(lack))
        if lack[worst] <= 1e-5:
            return foothold, first, last
        foothold -= offset[worst] * (lack[worst] / distance[worst])
    lack = np.hypot(*(foothold - under_hip).T) - radius
    fewest = len(under_hip) * (1.0 - LONGEST_RELEASE)
    while last - first + 1 > fewest and lack[first : last + 1].max() > 1e-3:
        if lack[first] > lack[last]:
            first += 1
        else:
            last -= 1
    return foothold, first, last


def _bridge(path: Array, own: Array, low: list[Array], clearance: float) -> None:
    """Fill the swing between two stances: the animal's own path plus a correction that fades from one into the other.

    In the plane it fades over the whole swing. Heights are over a line through the animal's standing heights before and
    after, and keep what lift-off and touch-down add only at the ends of the swing, so that its middle is the animal's.

    Args:
        path: To be filled between its first and its last frame, which stand [m], shape [num_frames, 3].
        own: The animal's own path [m], the same shape.
        low: How high the animal's foot stands before and after [m].
        clearance: Least height in the middle, unless the animal's is lower [m].
    """
    share, smooth, fade, bump = _swing_curves(len(path))
    corrected = own + (path[0] - own[0]) * (1.0 - smooth[:, None]) + (path[-1] - own[-1]) * smooth[:, None]
    height = own[:, 2] - (low[0] * (1.0 - share) + low[1] * share)
    height -= height[0] * fade + height[-1] * fade[::-1]
    least = min(clearance, max(float(height.max()), 0.0))
    corrected[:, 2] = np.maximum(height, least * bump)
    path[1:-1] = corrected[1:-1]


@lru_cache(maxsize=512)
def _swing_curves(num_frames: int) -> tuple[Array, Array, Array, Array]:
    """Return over a swing: its share that has passed, a smooth rise, a smooth fall within ``FADE``, and a bump."""
    share = np.linspace(0.0, 1.0, num_frames)
    return share, _smoothstep(share), _smoothstep(1.0 - share / FADE), np.sin(np.pi * share) ** 2


def _pull_in(path: Array, stands: Mask, under_hip: Array, radius: Array) -> Array:
    """Pull a swinging foot in the plane to where its leg reaches it, and return by how much [m]."""
    offset = path[:, :2] - under_hip
    distance = np.hypot(*offset.T)
    lack = np.where(stands, 0.0, np.maximum(distance - radius, 0.0))
    path[:, :2] -= offset * (lack / np.maximum(distance, 1e-9))[:, None]
    return lack


def median(values: Array) -> Array:
    """Return the median over the first axis, without NumPy's overhead, which is most of the work on short arrays."""
    ordered = np.sort(values, axis=0)
    return 0.5 * (ordered[(len(values) - 1) // 2] + ordered[len(values) // 2])


def _smoothstep(share: Array) -> Array:
    """Return 0 below 0, 1 above 1, and a smooth rise between."""
    x = np.minimum(np.maximum(share, 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)


def _drop_short(mask: Mask, value: bool, shortest: float) -> None:
    """Flip runs of ``value`` that are shorter than a number of frames, but for those at the ends."""
    for run in intervals(mask == value):
        touches_end = run.first == 0 or run.last == len(mask) - 1
        if not touches_end and run.last - run.first + 1 < shortest:
            mask[run.first : run.last + 1] = not value


def longest_stance(stance: NDArray[np.bool_]) -> int:
    """Return how long a foot stands at most, on and on over the seam [frames]; at most one cycle."""
    runs = [run for foot in np.concatenate([stance, stance]).T for run in intervals(foot)]
    return min(max((run.last - run.first + 1 for run in runs), default=0), len(stance))
