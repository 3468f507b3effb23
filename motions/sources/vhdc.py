"""Horses on a treadmill: the Vienna Horse Data Collection, Haflinger set."""

from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.keypoints import KEYPOINTS, LEG_NAMES, KeypointMotion
from kine2go_warp.motions.sources.base import MotionSource
from kine2go_warp.motions.sources.tables import parse_numbers, read_lines

Array = NDArray[np.float64]

MARKERS = ("Head", "Withers", "Sacrum", "HFL", "HFR", "HHL", "HHR")
HEADER = ["Frame", "Time", *(marker + axis for marker in MARKERS for axis in "XYZ")]
HOOVES = ("HFL", "HFR", "HHL", "HHR")
"""Hoof markers in the order FL, FR, RL, RR."""

TALLEST_HORSE = 3.0
"""Withers above this are not in millimetres [m]."""
SHORTEST_TRUNK = 0.1
"""A horse is longer than this between its markers [m]."""
STANCE_HEIGHT = 0.015
"""A hoof is taken to stand below this height over its lowest [m]."""
SMOOTHNESS = 10.0
"""Weight of a change of speed from frame to frame, against the slip of one standing hoof."""


class Vhdc(MotionSource):
    """CSV files of seven markers in millimetres, z up, 60 or 120 Hz.

    A treadmill moves under the horse, so the horse's own velocity is recovered from the hooves that stand: whatever
    velocity they have in the laboratory is the belt's.
    """

    name: ClassVar[str] = "vhdc"
    scale: ClassVar[float] = 0.25
    hip_half_width: ClassVar[float] = 0.0465 / 0.25
    """Half the distance that is put between the hips, for the horse's markers lie on its midline [m]."""

    def read(self, path: Path) -> KeypointMotion:
        """Read a whole file; see ``MotionSource.read``."""
        lines = read_lines(path)
        header = [name.strip().strip('"').rstrip("#") for name in lines[0].split(",")]
        if header != HEADER:
            raise ClipError(f"{path}, line 1: not the header of a VHDC file (expected {','.join(HEADER[:5])},...)")
        rows = parse_numbers(path, lines[1:], len(HEADER), 1e6, first_line=2)
        time = uniform_time(path, rows[:, 1])
        markers = 1e-3 * rows[:, 2:].reshape(len(rows), len(MARKERS), 3)
        if markers[..., 2].max() > TALLEST_HORSE:
            raise ClipError(f"{path}: a marker {markers[..., 2].max():.0f} m high; the file must be in millimetres")
        hooves = markers[:, [MARKERS.index(name) for name in HOOVES]]
        trunk = markers[:, MARKERS.index("Withers")] - markers[:, MARKERS.index("Sacrum")]
        if np.any(np.linalg.norm(trunk[:, :2], axis=1) < SHORTEST_TRUNK):
            line = int(np.argmin(np.linalg.norm(trunk[:, :2], axis=1))) + 2
            raise ClipError(f"{path}, line {line}: Withers and Sacrum are in one place; a marker was lost")
        velocity = belt_free_velocity(hooves, time[1] - time[0])
        travelled = np.vstack([np.zeros(2), np.cumsum(velocity[:-1], axis=0) * (time[1] - time[0])])
        markers[..., :2] += travelled[:, None]
        return KeypointMotion(time, self._keypoints(markers))

    def _keypoints(self, markers: Array) -> Array:
        """Return the keypoints, with hips set apart from the midline."""
        withers, sacrum = (markers[:, MARKERS.index(name)] for name in ("Withers", "Sacrum"))
        forward = withers - sacrum
        left = np.stack([-forward[:, 1], forward[:, 0], np.zeros(len(forward))], axis=1)
        left *= self.hip_half_width / np.linalg.norm(left, axis=1, keepdims=True)
        points = {"pelvis": sacrum, "neck": withers}
        for leg, hoof in zip(LEG_NAMES, HOOVES, strict=True):
            spine = withers if leg.startswith("F") else sacrum
            points[f"{leg}_hip"] = spine + (left if leg.endswith("L") else -left)
            points[f"{leg}_toe"] = markers[:, MARKERS.index(hoof)]
        return np.stack([points[name] for name in KEYPOINTS], axis=1)


def uniform_time(path: Path, stamps: Array) -> Array:
    """Return evenly spaced times [s] fitted to stamps that are rounded to milliseconds.

    Raises:
        ClipError: the stamps do not increase, or are not evenly spaced.
    """
    steps = np.diff(stamps)
    if np.any(steps <= 0.0):
        line = int(np.argmax(steps <= 0.0)) + 3
        raise ClipError(f"{path}, line {line}: the time does not increase")
    frames = np.arange(len(stamps))
    slope, start = np.polyfit(frames, stamps, 1)
    fitted = start + slope * frames
    if np.abs(fitted - stamps).max() > 0.5 * slope:
        line = int(np.argmax(np.abs(fitted - stamps))) + 2
        raise ClipError(f"{path}, line {line}: the times are not evenly spaced")
    return slope * frames


def belt_free_velocity(hooves: Array, frame_duration: float) -> Array:
    """Return the horse's velocity over the ground [m/s], shape [num_frames, 2].

    The velocity v of each frame minimises the slip of the hooves that stand, sum |v + u|^2 over their velocities u in
    the laboratory, and its own change from frame to frame, weighted by ``SMOOTHNESS``. The normal equations are
    tridiagonal. Heights take no part: a horse does not climb.
    """
    motion = np.gradient(hooves[..., :2], frame_duration, axis=0)
    standing = hooves[..., 2] - hooves[..., 2].min(axis=0) < STANCE_HEIGHT
    num_frames = len(hooves)
    bands = np.zeros((2, num_frames))
    bands[0, 1:] = -SMOOTHNESS
    bands[1] = standing.sum(axis=1) + SMOOTHNESS * (2.0 - (np.arange(num_frames) % (num_frames - 1) == 0))
    return solveh_banded(bands, -np.sum(motion * standing[..., None], axis=1))
