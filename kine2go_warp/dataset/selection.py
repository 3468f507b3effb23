"""Which trajectories of a dataset reviews rejected, and how trajectories are split."""

import hashlib
from collections.abc import Iterable

from kine2go_warp.dataset.motion import Motion, TrajectoryReference
from kine2go_warp.dataset.reviews import REJECTED, standing_reviews
from kine2go_warp.dataset.schema import REJECTED as REJECTED_GROUP


def rejected_trajectories(motion: Motion) -> frozenset[int]:
    """Return which stored trajectories of a motion were rejected in a review.

    Raises:
        DatasetError: the file of verdicts cannot be read.
    """
    standing = standing_reviews(motion)
    return frozenset(index for index, verdict in standing.items() if verdict.verdict == REJECTED)


def validation_indices(motion: Motion, fraction: float, seed: int) -> frozenset[int]:
    """Return which trajectories of a motion are for validation, of accepted and of rejected ones alike.

    Each trajectory is ranked by a hash of seed, motion and index, so that neither other motions nor the choice of
    trajectories moves one from one side to the other.

    Args:
        motion: The motion.
        fraction: Share of the trajectories, between 0 and 1. Where it is neither and there are two trajectories, each
            side gets at least one.
        seed: Another seed gives another split.
    """
    accepted = motion.num_accepted
    others = held_out(f"{motion.name}/{REJECTED_GROUP}", len(motion.lengths) - accepted, fraction, seed)
    return held_out(motion.name, accepted, fraction, seed) | {accepted + index for index in others}


def held_out(motion: str, num_trajectories: int, fraction: float, seed: int) -> frozenset[int]:
    """Return the indices of the first trajectories by their rank."""
    count = round(fraction * num_trajectories)
    if 0.0 < fraction < 1.0 and num_trajectories > 1:
        count = min(max(count, 1), num_trajectories - 1)
    ranked = sorted(range(num_trajectories), key=lambda index: _rank(f"{seed}/{motion}/{index}"))
    return frozenset(ranked[:count])


def by_motion(references: Iterable[TrajectoryReference]) -> dict[str, list[TrajectoryReference]]:
    """Return references grouped by their motions, in the order in which those appear."""
    groups: dict[str, list[TrajectoryReference]] = {}
    for reference in references:
        groups.setdefault(reference.motion, []).append(reference)
    return groups


def _rank(text: str) -> bytes:
    return hashlib.sha256(text.encode()).digest()
