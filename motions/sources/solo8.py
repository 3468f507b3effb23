"""Trajectories of the robot Solo8 (Li et al. 2023), one tensor for all of them."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.examination import check_angles, check_height
from kine2go_warp.motions.keypoints import KEYPOINTS, MINIMUM_FRAMES, KeypointMotion
from kine2go_warp.motions.sources.base import MotionSource
from kine2go_warp.quantities import LEG_NAMES

Array = NDArray[np.float64]

URDF = Path(__file__).with_name("solo8.urdf")
NUM_COLUMNS = 33
POSITION, QUATERNION, JOINTS, JOINT_SPEEDS = slice(0, 3), slice(3, 7), slice(17, 25), slice(25, 33)
LEG_PREFIXES = ("FL", "FR", "HL", "HR")
"""Legs in the order of the columns, which is also FL, FR, RL, RR."""
TRUNK_HALF_LENGTH = 0.1
"""How far neck and pelvis are put before and behind the base origin [m]."""
LARGEST_VALUE = 1e3
RATE_TOLERANCE = 0.25
"""How far the frame rate fitted to the file's own joint velocities may be from 50 Hz, relatively."""


class Solo8(MotionSource):
    """A tensor [trajectories, frames, 33] at 50 Hz; ``file.pt:K`` names trajectory K.

    Columns: base position 0:3 [m], base orientation 3:7 (x, y, z, w), joint positions 17:25 [rad] and velocities 25:33
    [rad/s], hip and knee of FL, FR, HL, HR. The velocities only serve to check the rate; the rest can be derived.
    """

    name: str = "solo8"
    scale: float = 1.33
    root_drop: float = 0.0
    forward_lift: float = 0.0
    foot_outward: float = 0.035
    """Go2's thighs sit 0.0955 m beside its hips; Solo8's feet lie 0.0605 m beside theirs, after scaling."""
    rate: float = 50.0

    def data_file(self, path: Path) -> Path:
        """Return the file without the number of the trajectory."""
        name, colon, number = path.name.rpartition(":")
        return path.with_name(name) if colon and number.isdigit() else path

    def read(self, path: Path) -> KeypointMotion:
        """Read one trajectory; see ``MotionSource.read``."""
        rows = read_trajectory(self.data_file(path), path)
        rate = fitted_rate(rows[:, JOINTS], rows[:, JOINT_SPEEDS])
        if abs(rate / self.rate - 1.0) > RATE_TOLERANCE:
            raise ClipError(f"{path}: its joint velocities fit {rate:.0f} frames a second, not {self.rate:.0f}")
        rotation = Rotation.from_quat(rows[:, QUATERNION])
        base = rows[:, POSITION]
        hips, feet = leg_points(rows[:, JOINTS])
        forward = rotation.apply([TRUNK_HALF_LENGTH, 0.0, 0.0])
        points = {"pelvis": base - forward, "neck": base + forward}
        for index, leg in enumerate(LEG_NAMES):
            points[f"{leg}_hip"] = base + rotation.apply(hips[index])
            points[f"{leg}_toe"] = base + rotation.apply(feet[:, index])
        position = np.stack([points[name] for name in KEYPOINTS], axis=1)
        check_height(base[:, 2], position[:, -4:, 2], str(path))
        return KeypointMotion(np.arange(len(rows)) / self.rate, position)


def fitted_rate(joints: Array, speeds: Array) -> float:
    """Return the frame rate at which joint positions change as their velocities say [Hz].

    The least-squares fit of the changes to the mean velocities; 50 Hz where nothing moves.
    """
    changes, means = np.diff(joints, axis=0), 0.5 * (speeds[1:] + speeds[:-1])
    product = np.sum(changes * means)
    return float(np.sum(means**2) / product) if product > 1e-9 else Solo8.rate


def leg_points(joints: Array) -> tuple[Array, Array]:
    """Return hip joints, shape [4, 3], and feet, shape [num_frames, 4, 3], in the base frame [m].

    Forward kinematics of our URDF, whose axes are all the base's y axis.
    """
    root = ElementTree.parse(URDF).getroot()

    def offset(joint: str) -> Array:
        element = root.find(f"joint[@name='{joint}']/origin")
        assert element is not None
        return np.array([float(value) for value in element.attrib["xyz"].split()])

    hips = np.array([offset(f"{leg}_HFE") for leg in LEG_PREFIXES])
    feet = np.empty((len(joints), 4, 3))
    for index, leg in enumerate(LEG_PREFIXES):
        hip, knee = (Rotation.from_rotvec(joints[:, [2 * index + side]] * [0.0, 1.0, 0.0]) for side in (0, 1))
        feet[:, index] = hips[index] + hip.apply(offset(f"{leg}_KFE") + knee.apply(offset(f"{leg}_ANKLE")))
    return hips, feet


def read_trajectory(file: Path, named: Path) -> Array:
    """Return one trajectory, shape [num_frames, 33].

    Raises:
        ClipError: no trajectory is named, the file is missing or holds something else, or the number is too large.
    """
    if file == named:
        raise ClipError(f"{named}: name a trajectory of the file, as in {named.name}:0")
    tensor = load_tensor(file)
    number = int(named.name.rpartition(":")[2])
    if number >= len(tensor):
        raise ClipError(f"{file}: no trajectory {number}; it holds {len(tensor)}, from 0 on")
    rows = tensor[number]
    fits = np.all(np.abs(rows) <= LARGEST_VALUE, axis=1)
    if not np.all(fits):
        frame = int(np.argmin(fits))
        raise ClipError(f"{named}, frame {frame}: a value is not finite or its magnitude exceeds {LARGEST_VALUE:g}")
    if np.any(np.abs(np.linalg.norm(rows[:, QUATERNION], axis=1) - 1.0) > 1e-2):
        raise ClipError(f"{named}: columns 3 to 6 are not unit quaternions")
    check_angles(rows[:, JOINTS], str(named))
    return rows


def load_tensor(file: Path) -> Array:
    """Return the tensor in a file without running any code in it, shape [trajectories, frames, 33].

    Raises:
        ClipError: the file is missing, or holds something else.
    """
    import torch  # only this source needs it

    if file.is_dir():
        raise ClipError(f"{file}: is a folder, not a motion file")
    if not file.exists():
        raise ClipError(f"{file}: no such motion file")
    try:
        tensor = torch.load(file, map_location="cpu", weights_only=True, mmap=False)
    except Exception as error:  # noqa: BLE001 - damaged files raise errors of many kinds
        raise ClipError(f"{file}: not a tensor file that can be read safely ({error.__class__.__name__})") from None
    shape = tuple(getattr(tensor, "shape", ()))
    if not torch.is_tensor(tensor) or len(shape) != 3 or shape[2] != NUM_COLUMNS or shape[1] < MINIMUM_FRAMES:
        raise ClipError(f"{file}: holds {type(tensor).__name__} of shape {shape}, not [trajectories, frames, 33]")
    if not tensor.is_floating_point() or tensor.layout != torch.strided:
        raise ClipError(f"{file}: holds a {tensor.layout} tensor of {tensor.dtype}, not a dense one of real numbers")
    return tensor.double().numpy()
