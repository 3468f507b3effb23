"""Parametric dog gaits: the bundled clip, and the ground truth of the tests.

Feet stand still while they stand: footholds are computed first, and the swing joins them smoothly. Lengths are those
of a dog, before a source's scale is applied.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.files import atomic_file
from kine2go_warp.motions.sources.ai4animation import COLUMN_OF_KEYPOINT, NUM_POINTS

Array = NDArray[np.float64]

TROT = (0.0, 0.5, 0.5, 0.0)
"""Phases at which FL, FR, RL, RR touch down: diagonal legs together."""
PACE = (0.0, 0.5, 0.0, 0.5)
"""Legs of one side together."""
WALK = (0.0, 0.5, 0.75, 0.25)
"""One leg after the other."""


@dataclass(frozen=True)
class DogGait:
    """A periodic gait of a dog that moves along a straight line or a circle at constant speed."""

    phases: tuple[float, float, float, float] = TROT
    """When in the stride FL, FR, RL, RR touch down, in [0, 1)."""
    stride_frames: int = 30
    """Frames in one stride."""
    rate: float = 60.0
    """Frames per second [Hz]."""
    speed: float = 0.75
    """[m/s]"""
    turn_rate: float = 0.0
    """[rad/s]"""
    duty: float = 0.55
    """Share of the stride that a foot stands."""
    step_height: float = 0.07
    """How high a toe is lifted [m]."""
    body_height: float = 0.43
    """Height of the middle of the trunk [m]."""
    body_bob: float = 0.005
    """Amplitude of the trunk's vertical motion, twice a stride [m]."""
    dip: float = 0.0
    """How far the trunk goes down and up again, once in ``dip_time`` [m]."""
    dip_time: float = 2.0
    """[s]"""
    toe_height: float = 0.01
    """Height of the toe keypoint of a standing foot [m]."""
    brisk: bool = False
    """Whether a foot leaves the floor at full speed and hits it so, as animals' do, instead of rising from rest."""

    @property
    def stride_time(self) -> float:
        """Duration of one stride [s]."""
        return self.stride_frames / self.rate


CROUCH = DogGait(phases=(0.0, 0.0, 0.0, 0.0), stride_frames=100_000, speed=0.0, dip=0.13)
"""A dog that stands, goes down and rises again, for minutes: no foot is ever lifted."""

TRUNK_HALF_LENGTH = 0.2
HIP_HALF_WIDTH = 0.043
NECK_DROP = 0.0485
"""How far the neck lies below the pelvis [m]; with the source's forward lift the trunk comes out level."""
HIP_DROP = 0.05
"""How far hips and shoulders lie below the middle of the trunk [m]."""
HIP_OF_LEG = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]]) * [TRUNK_HALF_LENGTH, HIP_HALF_WIDTH]


@dataclass(frozen=True)
class GeneratedMotion:
    """A gait and what is known about it."""

    points: Array
    """All 27 points [m], z up, shape [num_frames, 27, 3]."""
    contact: NDArray[np.bool_]
    """Whether each foot stands, FL, FR, RL, RR, shape [num_frames, 4]."""
    trunk: Array
    """Middle of the trunk [m], shape [num_frames, 3]."""
    heading: Array
    """[rad], shape [num_frames]."""


def generate(gait: DogGait, num_frames: int) -> GeneratedMotion:
    """Generate a gait from time 0 on."""
    time = np.arange(num_frames) / gait.rate
    trunk, heading = _trunk(gait, time)
    points = np.empty((num_frames, NUM_POINTS, 3))
    points[:] = trunk[:, None]
    contact = np.empty((num_frames, 4), dtype=bool)
    for leg, name in enumerate(("FL", "FR", "RL", "RR")):
        hip = trunk + _turned(np.append(HIP_OF_LEG[leg], -HIP_DROP), heading)
        toe, contact[:, leg] = _toe(gait, leg, time)
        first, last = COLUMN_OF_KEYPOINT[f"{name}_hip"], COLUMN_OF_KEYPOINT[f"{name}_toe"]
        # The points between hip and toe are not used; a straight leg keeps the file plausible.
        share = np.linspace(0.0, 1.0, last - first + 1)[None, :, None]
        points[:, first : last + 1] = hip[:, None] * (1.0 - share) + toe[:, None] * share
    half = 0.5 * NECK_DROP
    points[:, COLUMN_OF_KEYPOINT["pelvis"]] = trunk + _turned(np.array([-TRUNK_HALF_LENGTH, 0.0, half]), heading)
    points[:, COLUMN_OF_KEYPOINT["neck"]] = trunk + _turned(np.array([TRUNK_HALF_LENGTH, 0.0, -half]), heading)
    return GeneratedMotion(points, contact, trunk, heading)


def write_ai4animation(points: Array, path: Path) -> None:
    """Write points (z up, shape [num_frames, 27, 3]) in AI4Animation's text format (y up)."""
    x, y, z = np.moveaxis(points, -1, 0)
    rows = np.stack([x, z, -y], axis=-1).reshape(len(points), -1)
    with atomic_file(path) as temporary:
        np.savetxt(temporary, rows, fmt="%.5f", delimiter=",\t")


def _trunk(gait: DogGait, time: Array) -> tuple[Array, Array]:
    """Return the middle of the trunk [m] and the heading [rad] at some times."""
    heading = gait.turn_rate * time
    if abs(gait.turn_rate) > 1e-9:
        radius = gait.speed / gait.turn_rate
        x, y = radius * np.sin(heading), radius * (1.0 - np.cos(heading))
    else:
        x, y = gait.speed * time, np.zeros_like(time)
    z = gait.body_height + gait.body_bob * np.cos(4.0 * np.pi * time / gait.stride_time)
    z -= gait.dip * np.sin(np.pi * time / gait.dip_time) ** 2
    return np.stack([x, y, z], axis=-1), heading


def _toe(gait: DogGait, leg: int, time: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return the positions of a toe [m] and whether it stands."""
    strides = time / gait.stride_time - gait.phases[leg]
    stride = np.floor(strides)
    progress = strides - stride
    standing = progress < gait.duty
    here, there = _foothold(gait, leg, stride), _foothold(gait, leg, stride + 1.0)
    swing = np.clip((progress - gait.duty) / (1.0 - gait.duty), 0.0, 1.0)
    if gait.brisk:
        share, lift = 0.5 * (1.0 - np.cos(np.pi * swing)), np.sin(np.pi * swing)
    else:
        # A cycloid: velocity and lifting speed vanish at both ends of the swing.
        share = swing - np.sin(2.0 * np.pi * swing) / (2.0 * np.pi)
        lift = 0.5 * (1.0 - np.cos(2.0 * np.pi * swing))
    toe = here * (1.0 - share[:, None]) + there * share[:, None]
    toe[:, 2] = gait.toe_height + gait.step_height * lift
    return toe, standing


def _foothold(gait: DogGait, leg: int, stride: Array) -> Array:
    """Return where a foot stands in a stride: below its hip at the middle of the stance."""
    middle = (stride + gait.phases[leg] + 0.5 * gait.duty) * gait.stride_time
    trunk, heading = _trunk(gait, middle)
    return trunk + _turned(np.append(HIP_OF_LEG[leg], 0.0), heading)


def _turned(offset: Array, heading: Array) -> Array:
    """Turn one offset by every heading, shape [num_frames, 3]."""
    cosine, sine = np.cos(heading), np.sin(heading)
    x, y, z = offset
    return np.stack([cosine * x - sine * y, sine * x + cosine * y, np.full_like(heading, z)], axis=-1)
