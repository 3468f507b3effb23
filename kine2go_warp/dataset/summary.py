"""A table of what a dataset holds, computed from the data written."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from kine2go_warp.dataset.access import Dataset, open_dataset
from kine2go_warp.metrics import tracking_quality


@dataclass(frozen=True)
class MotionSummary:
    """One motion of a dataset in metrics, means over the trajectories that no review rejected; NaN if none is left."""

    motion: str
    accepted: int
    total: int
    """Rollouts run, rejected ones included."""
    rejected_in_review: int
    """Accepted trajectories that somebody rejected later; loaders, exports and scores leave them out."""
    shortest: float
    """Duration of the shortest trajectory [s]."""
    longest: float
    """Duration of the longest trajectory [s]."""
    joint_rmse: float
    """[rad]"""
    root_error: float
    """[m]"""
    root_angle: float
    """[rad]"""
    foot_error: float
    """[m]"""


def summarise(path: Path, motions: Sequence[str] | None = None) -> list[MotionSummary]:
    """Return a summary of each of some motions of a dataset, by default of all."""
    dataset = open_dataset(path)
    return [summarise_motion(dataset, motion) for motion in (dataset.motions if motions is None else motions)]


def summarise_motion(dataset: Dataset, motion: str) -> MotionSummary:
    """Return a summary of one motion."""
    data, stored = dataset.load(motion), len(dataset.motion(motion).lengths)
    durations = data.trajectories.draws["length"] * data.frame_duration
    measured = {"shortest": durations.min, "longest": durations.max}
    measured |= {name: values.mean for name, values in tracking_quality(data.trajectories.rows).items()}
    return MotionSummary(
        motion=motion,
        accepted=stored,
        total=stored + sum(data.attributes["rejected"].values()),
        rejected_in_review=len(dataset.left_out(motion)),
        **{name: float(compute()) if len(durations) else math.nan for name, compute in measured.items()},
    )
