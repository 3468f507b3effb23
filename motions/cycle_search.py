"""Finding where a motion repeats itself, so that nobody has to watch videos for it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.motions.config import CYCLE_TIMES
from kine2go_warp.motions.keypoints import MINIMUM_FRAMES
from kine2go_warp.motions.poses import Poses
from kine2go_warp.rotations import heading, to_rotation, turn_planar

Array = NDArray[np.float64]
Indices = NDArray[np.signedinteger]

LARGEST_OVERLAP = 0.5
"""Two candidates that share more than this of the frames that either has are one."""
MULTIPLE_SCORE = 2.0, 0.1
"""A range is several turns of a shorter cycle if that one closes with a score of at most this many times its own, plus
this; a turn may differ from the cycle's length by ``MULTIPLE_LENGTH``."""
MULTIPLE_LENGTH = 0.12
STEADY = 0.02
"""The base goes somewhere if it moves by this within the shortest cycle [m]; less is sway and jitter."""


@dataclass(frozen=True)
class CycleCandidate:
    """A range of frames that begins and ends in nearly the same state."""

    start: int
    end: int
    """Exclusive: the frame that is like frame ``start``."""
    score: float
    """Distance between the two states, in standard deviations of the motion; 0 is a perfect seam."""


def pose_features(targets: Poses) -> Array:
    """Return what must agree across a seam: height, tilt and feet as seen from the root, and how they change.

    Each is divided by its own standard deviation. Shape [num_frames, num_features].
    """
    yaw = heading(targets.root_orientation)
    assert targets.feet is not None
    feet = turn_planar(targets.feet - targets.root_position[:, None], -yaw[:, None])
    tilt = to_rotation(targets.root_orientation).as_matrix()[:, 2]
    velocity = turn_planar(np.gradient(targets.root_position, axis=0), -yaw)
    pose = np.hstack([targets.root_position[:, 2:], tilt, feet.reshape(len(feet), -1)])
    change = np.hstack([np.gradient(feet.reshape(len(feet), -1), axis=0), velocity])
    features = np.hstack([pose, change])
    return features / np.maximum(features.std(axis=0), 1e-3)


def seam_scores(features: Array, starts: Indices, ends: Indices) -> Array:
    """Return the distance between each start and each end, shape [num_starts, num_ends]."""
    a, b = features[starts], features[ends]
    squares = np.sum(a**2, axis=1)[:, None] + np.sum(b**2, axis=1) - 2.0 * a @ b.T
    return np.sqrt(np.maximum(squares, 0.0) / features.shape[1])


def seam_score(targets: Poses, start: int, end: int) -> float:
    """Return the distance between two frames, in standard deviations of the motion."""
    return float(seam_scores(pose_features(targets), np.array([start]), np.array([end]))[0, 0])


def best_cycle(targets: Poses, start: int, end: int, reach_frames: int) -> tuple[int, int]:
    """Return the best start and end within some frames of the ones given.

    Ranges that reach to the last frame have no frame after them to compare with; their end may only move inwards.
    """
    return best_ends(pose_features(targets), start, end, reach_frames)


def best_ends(features: Array, start: int, end: int, reach_frames: int) -> tuple[int, int]:
    """Return the same from the features of the motion."""
    last = len(features) - 1
    # A short cycle must not lose its stride to the search.
    reach = max(min(reach_frames, (end - start) // 6), 0)
    starts = np.arange(max(start - reach, 0), start + reach + 1)
    ends = np.arange(end - reach, min(end + reach, last) + 1)
    if len(ends) == 0 or reach == 0:
        return start, end
    scores = seam_scores(features, starts, ends)
    best = np.unravel_index(int(np.argmin(scores)), scores.shape)
    return int(starts[best[0]]), int(ends[best[1]])


def find_cycles(
    targets: Poses, min_frames: int, max_frames: int, count: int, travel: float = 0.0
) -> list[CycleCandidate]:
    """Return the best ranges of a whole motion, best first; several turns of one cycle are left out.

    Args:
        targets: The motion.
        min_frames: Shortest range.
        max_frames: Longest range.
        count: How many to return.
        travel: Least way that the base must go in a range [m], to leave out standing still.
    """
    features = pose_features(targets)
    frames = np.arange(len(features))
    way = way_gone(targets.root_position[:, :2], min_frames)
    found: list[CycleCandidate] = []
    for start in frames:
        ends = frames[start + min_frames : start + max_frames + 1]
        ends = ends[way[ends] - way[start] >= travel]
        if len(ends) == 0:
            continue
        scores = seam_scores(features, frames[start : start + 1], ends)[0]
        # Only local minima: the neighbours of a good end are nearly as good and tell nothing new.
        padded = np.pad(scores, 1, constant_values=np.inf)
        minima = np.flatnonzero((scores <= padded[:-2]) & (scores <= padded[2:]))
        minima = minima[single_turns(ends[minima] - start, scores[minima])]
        found += [CycleCandidate(int(start), int(ends[index]), float(scores[index])) for index in minima]
    found.sort(key=lambda one: one.score)
    starts, ends = np.array([(one.start, one.end) for one in found], dtype=int).reshape(-1, 2).T
    is_free = np.ones(len(found), dtype=bool)
    chosen: list[CycleCandidate] = []
    while is_free.any() and len(chosen) < count:
        best = found[int(np.argmax(is_free))]
        chosen.append(best)
        is_free &= overlaps(best, starts, ends) <= LARGEST_OVERLAP
    return chosen


def cycle_frames(rate: float, times: tuple[float, float] = CYCLE_TIMES) -> tuple[int, int]:
    """Return the shortest and the longest cycle in frames.

    Args:
        rate: Frames per second [Hz].
        times: The same [s].
    """
    return max(round(times[0] * rate), MINIMUM_FRAMES), round(times[1] * rate)


def single_turns(lengths: Indices, scores: Array) -> NDArray[np.bool_]:
    """Return which ranges that begin at one frame are not several turns of a shorter one.

    Args:
        lengths: In frames, shape [num_ranges].
        scores: Of their seams, shape [num_ranges].
    """
    turns = lengths[:, None] / lengths
    whole = np.round(turns)
    factor, more = MULTIPLE_SCORE
    is_several = (whole >= 2) & (np.abs(turns - whole) <= MULTIPLE_LENGTH * whole)
    return ~np.any(is_several & (scores <= factor * scores[:, None] + more), axis=1)


def way_gone(position: Array, frames: int) -> Array:
    """Return how far the base has gone until each frame [m], shape [num_frames], sway and jitter left out.

    Args:
        position: Of the base in the ground plane [m], shape [num_frames, 2].
        frames: Over which it must get somewhere.
    """
    index = np.arange(len(position))
    after, before = np.minimum(index + frames // 2, len(position) - 1), np.maximum(index - (frames + 1) // 2, 0)
    moved = np.linalg.norm(position[after] - position[before], axis=1)
    return np.cumsum(np.where(moved >= STEADY, moved / np.maximum(after - before, 1), 0.0))


def overlaps(one: CycleCandidate, starts: Indices, ends: Indices) -> Array:
    """Return for each of many ranges the share of the frames of it and of one range that both have."""
    shared = np.maximum(np.minimum(one.end, ends) - np.maximum(one.start, starts), 0)
    return shared / (one.end - one.start + ends - starts - shared)
