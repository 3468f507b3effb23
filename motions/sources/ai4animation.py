"""Dog motion capture of the AI4Animation project as exported text (Zhang et al. 2018; Peng et al. 2020)."""

from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.keypoints import KEYPOINTS, MINIMUM_FRAMES, KeypointMotion
from kine2go_warp.motions.sources.base import MotionSource

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

    name: ClassVar[str] = "ai4animation"
    scale: ClassVar[float] = 0.825
    rate: ClassVar[float] = 60.0

    def read(self, path: Path) -> KeypointMotion:
        """Read a whole file; see ``MotionSource.read``."""
        rows = read_number_table(path, 3 * NUM_POINTS)
        points_y_up = rows.reshape(len(rows), NUM_POINTS, 3)
        columns = [COLUMN_OF_KEYPOINT[name] for name in KEYPOINTS]
        x, y, z = np.moveaxis(points_y_up[:, columns], -1, 0)
        time = np.arange(len(rows)) / self.rate
        return KeypointMotion(time, np.stack([x, -z, y], axis=-1))


def read_number_table(path: Path, num_columns: int) -> NDArray[np.float64]:
    """Read a comma-separated text file of finite numbers.

    Returns:
        The numbers, shape [num_lines, num_columns].

    Raises:
        ClipError: the file is missing, not text, has too few lines, a line of another width, or something that is not
            a finite number.
    """
    lines = read_text_lines(path)
    rows = np.empty((len(lines), num_columns))
    for index, line in enumerate(lines):
        where = f"{path}, line {index + 1}"
        fields = line.rstrip().rstrip(",").split(",")
        if len(fields) != num_columns:
            raise ClipError(f"{where}: {len(fields)} columns instead of {num_columns}")
        try:
            rows[index] = [float(field) for field in fields]
        except ValueError as error:
            raise ClipError(f"{where}: not a number ({error})") from None
        if not np.all(np.abs(rows[index]) <= LARGEST_COORDINATE):
            raise ClipError(f"{where}: a coordinate is not finite or beyond {LARGEST_COORDINATE:g} m")
    return rows


def read_text_lines(path: Path) -> list[str]:
    """Return the non-empty lines at the beginning of a text file.

    Raises:
        ClipError: there is no such file, it is not text, or it has too few lines for a motion.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ClipError(f"{path}: no such motion file") from None
    except IsADirectoryError:
        raise ClipError(f"{path}: is a folder, not a motion file") from None
    except UnicodeDecodeError:
        raise ClipError(f"{path}: not a text file") from None
    except OSError as error:
        raise ClipError(f"{path}: cannot be read ({error.strerror})") from None
    lines = text.rstrip().splitlines()
    if len(lines) < MINIMUM_FRAMES:
        raise ClipError(f"{path}: {len(lines)} line(s); a motion needs at least {MINIMUM_FRAMES} frames")
    return lines
