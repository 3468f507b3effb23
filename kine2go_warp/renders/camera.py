"""A camera that follows the robot smoothly: it knows the whole path and so lags behind nothing."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.rotations import heading

Array = NDArray[np.float64]

DISTANCE = 1.5
"""From the camera to what it looks at [m]."""
ELEVATION = -16.0
"""How the camera looks up; negative is down [deg]."""
SIDE = 125.0
"""Direction of view from that of the robot [deg]: from the front, on the robot's left."""
SMOOTHING = 0.25
"""Standard deviation of the window over which the robot's place is averaged [s]."""
TURN_SMOOTHING = 1.0
"""The same of its heading [s]."""


@dataclass(frozen=True)
class Pose:
    """Where a robot is and how it holds its legs."""

    root_position: NDArray[np.floating]
    """Base link origin in the world [m], shape [3]."""
    root_orientation: NDArray[np.floating]
    """Base link in the world, (w, x, y, z), shape [4]."""
    joint_position: NDArray[np.floating]
    """In the order of ``RobotSpec.joint_names`` [rad], shape [12]."""


@dataclass(frozen=True)
class View:
    """Where the camera looks."""

    target: Array
    """Middle of the picture [m], shape [3]."""
    azimuth: float
    """Direction of view in the plane, from the world's x axis [deg]."""
    distance: float = DISTANCE
    """[m]"""
    elevation: float = ELEVATION
    """[deg]"""


@dataclass(frozen=True)
class FollowCamera:
    """The camera of one trajectory."""

    targets: Array
    """What it looks at for each row [m], shape [num_rows, 3]."""
    azimuths: Array
    """Where it looks for each row [deg], shape [num_rows]."""
    size: float = 1.0
    """Of the robot, over the Go2's; the camera stays as much farther away."""

    @classmethod
    def of(
        cls, root_position: NDArray[Any], root_orientation: NDArray[Any], rate: float, size: float = 1.0
    ) -> "FollowCamera":
        """Follow a path.

        Args:
            root_position: [m], shape [num_rows, 3].
            root_orientation: (w, x, y, z), shape [num_rows, 4].
            rate: Rows a second [Hz].
            size: Of the robot, over the Go2's.
        """
        yaw = np.unwrap(heading(root_orientation)).astype(np.float64)
        targets = smoothed(np.asarray(root_position, np.float64), SMOOTHING * rate)
        targets[:, 2] -= 0.06 * size  # the middle of the robot is lower than its base
        return cls(targets, np.rad2deg(smoothed(yaw[:, None], TURN_SMOOTHING * rate)[:, 0]) + SIDE, size)

    def view(self, row: int) -> View:
        """Return the view of a row."""
        return View(self.targets[row], float(self.azimuths[row]), self.size * DISTANCE)


def smoothed(values: Array, deviation: float) -> Array:
    """Return values averaged over a Gaussian window, shape [num_rows, num_columns].

    Beyond the ends they go on as they began, mirrored in the point where they end, so that a straight path at even
    speed stays as it is.
    """
    from scipy.ndimage import gaussian_filter1d

    margin = int(np.ceil(4.0 * deviation))
    if len(values) < 2 or margin < 1:
        return values.copy()
    extended = np.pad(values, ((margin, margin), (0, 0)), mode="reflect", reflect_type="odd")
    return gaussian_filter1d(extended, deviation, axis=0, mode="nearest")[margin:-margin]
