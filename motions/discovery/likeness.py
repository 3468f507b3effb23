"""Which motions are nearly the same, and how much of the recordings is not a copy of another part."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from kine2go_warp.motions.discovery.cuts import Cut
from kine2go_warp.motions.discovery.gaits import shape_of
from kine2go_warp.motions.discovery.recording import Recording

Array = NDArray[np.float64]

MOMENTS = 32
"""At so many moments two motions are compared."""
SAME_SHAPE = 0.03
"""Motions whose feet, base height and tilt differ by less in the mean (root of mean squares) are nearly the same [m].
One stride of a dog's steady pace differs from another by 6 to 31 mm."""
SAME_SPEED, SAME_TURN, SAME_TIME = 0.15, 0.3, 0.15
"""So must their speeds [m/s], their turn rates [rad/s], and their durations, relatively."""
SHARED = 0.5
"""Motions of one kind are nearly the same if they share this part of the frames of the shorter one."""
WINDOW = 1.0
"""Parts of recordings of this length are compared [s]."""
WINDOW_STEPS = 8
"""At so many moments of a window."""
SAME_WINDOW = 0.004
"""A window is a copy of another if their shapes differ by less in the mean [m]. Two strides of an animal never are as
close as this, two exports of one session are."""
LEADING = 12
"""Principal components by which windows are looked up before all of their numbers are compared."""


def shape_distance(one: Array, other: Array, is_cycle: bool) -> float:
    """Return by how much two shapes differ in the mean [m]; of cycles, where their phases match best."""
    shifts = range(len(one)) if is_cycle else (0,)
    return min(float(np.sqrt(np.mean((one - np.roll(other, shift, axis=0)) ** 2) * 3.0)) for shift in shifts)


def shape(cut: Cut) -> Array:
    """Return a motion's shape at ``MOMENTS`` moments."""
    return shape_of(cut.recording, cut.start, cut.end, MOMENTS)


def is_near(one: Cut, other: Cut, shapes: tuple[Array, Array]) -> bool:
    """Return whether two motions are nearly the same: of the same frames, or of one label, speed and shape."""
    a, b = one.gait, other.gait
    shorter = min(one.end - one.start, other.end - other.start)
    shared = min(one.end, other.end) - max(one.start, other.start)
    if one.kind == other.kind and one.recording is other.recording and shared > SHARED * shorter:
        return True
    if (one.kind, one.label) != (other.kind, other.label) or abs(a.turn_rate - b.turn_rate) > SAME_TURN:
        return False
    if max(abs(a.speed - b.speed), abs(a.sideways - b.sideways)) > SAME_SPEED:
        return False
    if one.kind != "still" and abs(np.log(a.duration / b.duration)) > SAME_TIME:
        return False
    return shape_distance(*shapes, one.kind == "cycle") < SAME_SHAPE


def unique_time(recordings: Sequence[Recording]) -> float:
    """Return how much of the recordings is no copy of an earlier part of them [s].

    A part is a window of ``WINDOW``; stillness counts once for each pose in which the animal is still.
    """
    windows = [window_shapes(one) for one in recordings]
    moments = [len(one) for one in windows]
    if sum(moments) == 0:
        return sum(one.duration for one in recordings)
    values = np.concatenate(windows).astype(np.float32)
    centred = values - values.mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    leading = centred @ axes[:, -LEADING:]
    radius = SAME_WINDOW * np.sqrt(values.shape[1] / 3.0)
    kept = np.ones(len(values), dtype=bool)
    tree = KDTree(leading)
    for index, near in enumerate(tree.query_ball_point(leading, radius)):
        earlier = np.array([one for one in near if one < index and kept[one]], dtype=int)
        if len(earlier) and np.linalg.norm(values[earlier] - values[index], axis=1).min() < radius:
            kept[index] = False
    shares = np.split(kept, np.cumsum(moments)[:-1])
    return sum(
        one.duration * (share.mean() if len(share) else 1.0) for one, share in zip(recordings, shares, strict=True)
    )


def window_shapes(recording: Recording) -> Array:
    """Return the shapes of the windows that begin at each frame, shape [num_windows, WINDOW_STEPS * 15]."""
    length = round(WINDOW * recording.rate)
    frames = shape_of(recording, 0, len(recording.still), len(recording.still))
    starts = np.arange(max(len(frames) - length, 0))
    steps = np.round(np.linspace(0, length, WINDOW_STEPS, endpoint=False)).astype(int)
    return frames[starts[:, None] + steps].reshape(len(starts), -1)
