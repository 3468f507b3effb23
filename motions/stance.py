"""When each foot stands, and holding it in place while it does."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.motions.config import RetargetConfig

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SHORTEST_STANCE = 0.05
"""A foot that stands for less is taken to swing on [s]."""
SHORTEST_SWING = 0.04
"""A foot that is lifted for less is taken to stand on [s]."""


@dataclass(frozen=True)
class Interval:
    """Frames ``first`` to ``last``, both included."""

    first: int
    last: int


def detect_stance(feet: Array, root: Array, frame_duration: float, config: RetargetConfig) -> Mask:
    """Return whether each foot stands, shape [num_frames, 4].

    A foot comes to stand when it is low and slow, and leaves the floor when it is clearly no longer either; the gap
    between the two sets of thresholds keeps noise from toggling it.

    Args:
        feet: Heights over the standing height and planar positions [m], shape [num_frames, 4, 3].
        root: Base link origin [m], shape [num_frames, 3].
        frame_duration: [s]
        config: Thresholds.
    """
    speed = np.linalg.norm(np.gradient(feet[..., :2], frame_duration, axis=0), axis=-1)
    base_speed = np.linalg.norm(np.gradient(root[:, :2], frame_duration, axis=0), axis=-1)
    slow = config.stance_speed + 0.25 * base_speed[:, None]
    height = feet[..., 2]
    enters = (height < config.stance_height) & (speed < slow)
    leaves = (height > 2.0 * config.stance_height) | (speed > 1.6 * slow)
    stance = np.empty(enters.shape, dtype=bool)
    standing = enters[0]
    for frame in range(len(feet)):
        standing = (standing | enters[frame]) & ~leaves[frame]
        stance[frame] = standing
    for foot in range(feet.shape[1]):
        _drop_short(stance[:, foot], False, SHORTEST_SWING / frame_duration)
        _drop_short(stance[:, foot], True, SHORTEST_STANCE / frame_duration)
    return stance


def intervals(mask: Mask) -> list[Interval]:
    """Return the runs of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    return [Interval(int(first), int(end) - 1) for first, end in edges.reshape(-1, 2)]


def hold_feet(feet: Array, stance: Mask, config: RetargetConfig) -> Array:
    """Return feet that stand still where they stand and swing smoothly from one foothold to the next.

    Args:
        feet: Heights over the standing height and planar positions [m], shape [num_frames, 4, 3].
        stance: Whether each foot stands, shape [num_frames, 4].
        config: Settings.
    """
    held = feet.copy()
    for foot in range(feet.shape[1]):
        path, stances = held[:, foot], intervals(stance[:, foot])
        raw = feet[:, foot]
        footholds = [np.append(np.median(raw[one.first : one.last + 1, :2], axis=0), 0.0) for one in stances]
        for one, foothold in zip(stances, footholds, strict=True):
            path[one.first : one.last + 1] = foothold
        for index in range(len(stances) - 1):
            _bridge(path, raw, stances[index].last, stances[index + 1].first, config.swing_clearance)
        if stances:
            # Before the first and after the last stance the foothold's correction simply goes on.
            first, last = stances[0].first, stances[-1].last
            path[:first] = raw[:first] + (path[first] - raw[first])
            path[last + 1 :] = raw[last + 1 :] + (path[last] - raw[last])
        path[:, 2] = np.maximum(path[:, 2], 0.0)
    return held


def _bridge(path: Array, raw: Array, start: int, end: int, clearance: float) -> None:
    """Fill the swing between two footholds: the raw path plus a correction that fades from one into the other."""
    share = np.linspace(0.0, 1.0, end - start + 1)
    smooth = (share * share * (3.0 - 2.0 * share))[:, None]
    corrected = raw[start : end + 1] + (path[start] - raw[start]) * (1.0 - smooth) + (path[end] - raw[end]) * smooth
    lifted = clearance * np.sin(np.pi * share) ** 2
    corrected[:, 2] = np.maximum(corrected[:, 2], lifted)
    path[start + 1 : end] = corrected[1:-1]


def _drop_short(mask: Mask, value: bool, shortest: float) -> None:
    """Flip runs of ``value`` that are shorter than a number of frames, but for those at the ends."""
    for run in intervals(mask == value):
        touches_end = run.first == 0 or run.last == len(mask) - 1
        if not touches_end and run.last - run.first + 1 < shortest:
            mask[run.first : run.last + 1] = not value
