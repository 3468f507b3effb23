"""Horses on a treadmill: the Vienna Horse Data Collection, Haflinger set."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.examination import check_size, repaired
from kine2go_warp.motions.keypoints import KEYPOINTS, KeypointMotion
from kine2go_warp.motions.sources.base import MotionSource
from kine2go_warp.motions.sources.tables import parse_numbers, read_lines
from kine2go_warp.motions.stance import Mask, intervals
from kine2go_warp.quantities import LEG_NAMES

Array = NDArray[np.float64]

MARKERS = ("Head", "Withers", "Sacrum", "HFL", "HFR", "HHL", "HHR")
HEADER = ["Frame", "Time", *(marker + axis for marker in MARKERS for axis in "XYZ")]
HOOVES = ("HFL", "HFR", "HHL", "HHR")
"""Hoof markers in the order FL, FR, RL, RR."""

SHORTEST_TRUNK = 0.1
"""A horse is longer than this between its markers [m]."""
LOW_SHARE = 0.2
"""A hoof is low in this lowest part of the range of its heights."""
SPEED_TIME = 0.02
"""Hooves' velocities are differences over this time before and after a frame [s]."""
SLIP_SHARE, SLIP = 0.25, 0.1
"""A low hoof stands while its velocity is within this share of the belt's, and this [m/s]."""
SHORTEST_MIDDLE = 0.05
"""The middle half of a stance must last this long to tell the belt's speed [s]."""
CROWD_PASSES = 20
"""Iterations of the mean over the nearer half of the velocities; it settles within a few."""


class Vhdc(MotionSource):
    """CSV files of seven markers in millimetres, z up, 60 or 120 Hz.

    A treadmill moves under the horse at one speed, so the horse's way over the ground is what it moves in the
    laboratory and the way of the belt, whose velocity is that of the hooves that stand. Heights are as measured.
    """

    name: str = "vhdc"
    unit: str = "millimetres"
    scale: float = 0.25
    root_drop: float = 0.04
    forward_lift: float = 0.0
    foot_outward: float = 0.1
    hip_half_width: float = 0.0465 / 0.25
    """Half the distance that is put between the hips, for the horse's markers lie on its midline [m]."""

    def begins(self, line: str) -> bool:
        """Return whether a text file that begins with this line is likely one of this source's."""
        return header_of(line) == HEADER

    def read(self, path: Path) -> KeypointMotion:
        """Read a whole file; see ``MotionSource.read``."""
        lines = read_lines(path)
        header = header_of(lines[0])
        if header != HEADER:
            raise ClipError(f"{path}, line 1: not the header of a VHDC file (expected {','.join(HEADER[:5])},...)")
        rows = parse_numbers(path, lines[1:], len(HEADER), 1e6, first_line=2, names=HEADER)
        time = uniform_time(path, rows[:, 1])
        markers = 1e-3 * rows[:, 2:].reshape(len(rows), len(MARKERS), 3)
        trunk = np.linalg.norm(markers[:, MARKERS.index("Withers")] - markers[:, MARKERS.index("Sacrum")], axis=1)
        check_size(float(np.median(trunk)), self.scale, self.unit, str(path))
        rate = 1.0 / (time[1] - time[0])
        # Head is not used. Examined before the belt moves them, for a lost marker is at the laboratory's origin.
        markers[:, 1:], remarks = repaired(markers[:, 1:], MARKERS[1:], float(np.median(trunk)), rate, str(path))
        trunk = markers[:, MARKERS.index("Withers")] - markers[:, MARKERS.index("Sacrum")]
        if np.any(np.linalg.norm(trunk[:, :2], axis=1) < SHORTEST_TRUNK):
            line = int(np.argmin(np.linalg.norm(trunk[:, :2], axis=1))) + 2
            raise ClipError(f"{path}, line {line}: Withers and Sacrum are in one place; a marker was lost")
        hooves = markers[:, [MARKERS.index(name) for name in HOOVES]]
        belt, standing = belt_velocity(hooves, time[1] - time[0])
        markers[..., :2] -= time[:, None, None] * belt
        return KeypointMotion(time, self._keypoints(markers, standing), remarks)

    def _keypoints(self, markers: Array, standing: Mask) -> Array:
        """Return the keypoints.

        No marker is at a hip: hips are set apart from the midline, and put as far before withers or sacrum as the two
        hooves of the pair stand before it on average, so that each pair stands below its hips.
        """
        points = {"pelvis": markers[:, MARKERS.index("Sacrum")], "neck": markers[:, MARKERS.index("Withers")]}
        forward = (points["neck"] - points["pelvis"]) * [1.0, 1.0, 0.0]
        forward /= np.linalg.norm(forward, axis=1, keepdims=True)
        left = self.hip_half_width * np.cross([0.0, 0.0, 1.0], forward)
        toes = markers[:, [MARKERS.index(name) for name in HOOVES]]
        for pair, spine in ((slice(0, 2), points["neck"]), (slice(2, 4), points["pelvis"])):
            ahead = np.einsum("tkj,tj->tk", toes[:, pair] - spine[:, None], forward)
            # Hooves have a mean each before that of the pair, so that one that stands longer does not count for more.
            means = [ahead[standing[:, leg], side].mean() for side, leg in enumerate(range(4)[pair])]
            for side, leg in zip((left, -left), LEG_NAMES[pair], strict=True):
                points[f"{leg}_hip"] = spine + side + float(np.mean(means)) * forward
        points |= {f"{leg}_toe": toes[:, index] for index, leg in enumerate(LEG_NAMES)}
        return np.stack([points[name] for name in KEYPOINTS], axis=1)


def header_of(line: str) -> list[str]:
    """Return the names of columns in the first line of a file."""
    return [name.strip().strip('"').rstrip("#") for name in line.split(",")]


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


def belt_velocity(hooves: Array, frame_duration: float) -> tuple[Array, Mask]:
    """Return the velocity of the belt in the laboratory [m/s], shape [2], and when each hoof stands on it.

    A treadmill runs at one speed, and a hoof that stands moves as the belt does. So the belt's velocity is where the
    planar velocities of low hooves crowd, taken exactly as the median over all stances of the slope of a line through
    the middle half of the hoof's way: touch-down and lift-off take no part.

    Args:
        hooves: Positions in the laboratory [m], shape [num_frames, 4, 3].
        frame_duration: [s]

    Returns:
        The velocity, and whether each hoof stands, shape [num_frames, 4].
    """
    frames = np.arange(len(hooves))
    reach = max(round(SPEED_TIME / frame_duration), 1)
    after, before = np.minimum(frames + reach, len(hooves) - 1), np.maximum(frames - reach, 0)
    velocity = (hooves[after, :, :2] - hooves[before, :, :2]) / (frame_duration * (after - before))[:, None, None]
    lowest, highest = np.quantile(hooves[..., 2], [0.05, 0.95], axis=0)
    low = hooves[..., 2] <= lowest + LOW_SHARE * (highest - lowest)
    crowd = velocity[low]
    belt = np.median(crowd, axis=0)
    for _ in range(CROWD_PASSES):
        distance = np.linalg.norm(crowd - belt, axis=1)
        belt = crowd[distance <= np.median(distance)].mean(axis=0)
    slip = np.linalg.norm(velocity - belt, axis=-1)
    standing = low & (slip < SLIP_SHARE * np.linalg.norm(belt) + SLIP)
    slopes = []
    for leg in range(hooves.shape[1]):
        for stance in intervals(standing[:, leg]):
            quarter = (stance.last - stance.first + 1) // 4
            middle = frames[stance.first + quarter : stance.last + 1 - quarter]
            if len(middle) * frame_duration >= SHORTEST_MIDDLE:
                slopes.append(np.polyfit(middle * frame_duration, hooves[middle, leg, :2], 1)[0])
    standing[:, ~standing.any(axis=0)] = low[:, ~standing.any(axis=0)]
    return (np.median(slopes, axis=0) if slopes else belt), standing
