"""Reading a whole motion without the trajectories that were rejected in a review."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from kine2go_warp.dataset.motion import Motion
from kine2go_warp.dataset.reader import MotionData, read_motion
from kine2go_warp.dataset.selection import rejected_trajectories


def read_used(path: Path, motion: str) -> tuple[MotionData, int]:
    """Read a motion, and return how many of its trajectories were left out because somebody rejected them.

    Raises:
        DatasetError: the dataset or the motion is missing, or an array or the verdicts cannot be read.
    """
    data = read_motion(path, motion)
    left_out = rejected_trajectories(Motion(path, motion))
    if not left_out:
        return data, 0
    is_used = ~np.isin(np.arange(data.trajectories.num_trajectories), list(left_out))
    return replace(data, trajectories=data.trajectories.selected(is_used)), len(left_out)
