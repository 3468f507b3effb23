"""Dog motion capture of the AI4Animation project as exported text (Zhang et al. 2018; Peng et al. 2020)."""

from pathlib import Path

import numpy as np

from kine2go_warp.motions.keypoints import KEYPOINTS, KeypointMotion
from kine2go_warp.motions.sources.base import MotionSource
from kine2go_warp.motions.sources.tables import is_number, parse_numbers, read_lines

NUM_POINTS = 27

COLUMN_OF_KEYPOINT = {
    "pelvis": 0,
    "neck": 3,
    "FL_hip": 6,
    "FR_hip": 11,
    "RL_hip": 16,
    "RR_hip": 20,
    "FL_toe": 10,
    "FR_toe": 15,
    "RL_toe": 19,
    "RR_toe": 23,
}
"""Which of the 27 points is which keypoint."""

LARGEST_COORDINATE = 1000.0
"""A coordinate beyond this is not in metres [m]."""


class AI4Animation(MotionSource):
    """Text files with 27 points of a dog a line, comma separated, metres, y up, 60 Hz."""

    name: str = "ai4animation"
    scale: float = 0.825
    root_drop: float = 0.04
    forward_lift: float = 0.04
    foot_outward: float = 0.1
    rate: float = 60.0
    tells_rate: bool = False

    def begins(self, line: str) -> bool:
        """Return whether a text file that begins with this line is likely one of this source's."""
        words = line.rstrip().rstrip(",").split(",")
        return len(words) == 3 * NUM_POINTS and all(is_number(word) for word in words)

    def read(self, path: Path) -> KeypointMotion:
        """Read a whole file; see ``MotionSource.read``."""
        rows = parse_numbers(path, read_lines(path), 3 * NUM_POINTS, LARGEST_COORDINATE)
        points_y_up = rows.reshape(len(rows), NUM_POINTS, 3)
        columns = [COLUMN_OF_KEYPOINT[name] for name in KEYPOINTS]
        x, y, z = np.moveaxis(points_y_up[:, columns], -1, 0)
        time = np.arange(len(rows)) / self.rate
        return KeypointMotion(time, np.stack([x, -z, y], axis=-1))
