"""A table of what a dataset holds, computed from the data written."""

from dataclasses import dataclass
from pathlib import Path

from kine2go_warp.dataset.motion import Motion
from kine2go_warp.dataset.quality import tracking_quality
from kine2go_warp.dataset.reader import motion_names, read_motion
from kine2go_warp.dataset.selection import rejected_trajectories


@dataclass(frozen=True)
class MotionSummary:
    """One motion of a dataset in figures, means over all its trajectories."""

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


def summarise(path: Path) -> list[MotionSummary]:
    """Return a summary of every motion in a dataset."""
    return [summarise_motion(path, motion) for motion in motion_names(path)]


def summarise_motion(path: Path, motion: str) -> MotionSummary:
    """Return a summary of one motion."""
    data = read_motion(path, motion)
    quality = tracking_quality(data.trajectories.rows)
    lengths = data.trajectories.draws["length"]
    frame_duration = float(data.time[1] - data.time[0])
    return MotionSummary(
        motion=motion,
        accepted=len(lengths),
        total=len(lengths) + sum(data.attributes["rejected"].values()),
        rejected_in_review=len(rejected_trajectories(Motion(path, motion))),
        shortest=float(lengths.min()) * frame_duration,
        longest=float(lengths.max()) * frame_duration,
        joint_rmse=float(quality["joint_rmse"].mean()),
        root_error=float(quality["root_error"].mean()),
        root_angle=float(quality["root_angle"].mean()),
        foot_error=float(quality["foot_error"].mean()),
    )


def counted(count: int, noun: str) -> str:
    """Return a number of things in words, such as ``1 trajectory`` or ``2 trajectories``."""
    ending = {"y": "ies", "h": "hes"}.get(noun[-1], f"{noun[-1]}s")
    plural = noun[:-1] + ending
    return f"{count:,} {noun if count == 1 else plural}"
