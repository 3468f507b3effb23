"""Hops of the robot Solo8 in the layout of its data set: all feet leave the ground together and land together.

The base falls freely while nothing touches the ground, so that the motion is one that a robot of that size can make.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.files import atomic_file
from kine2go_warp.motions.body import GRAVITY
from kine2go_warp.motions.sources.solo8 import JOINT_SPEEDS, JOINTS, NUM_COLUMNS, POSITION, QUATERNION, Solo8

Array = NDArray[np.float64]

LEG_SEGMENT = 0.16
"""Length of upper and lower leg [m]."""
KNEE_SIDES = (1.0, 1.0, -1.0, -1.0)
"""Knees of FL, FR point back, those of HL, HR forward."""
LINEAR_VELOCITY, GRAVITY_DIRECTION, HEIGHT = slice(7, 10), slice(13, 16), 16


@dataclass(frozen=True)
class Hop:
    """A hop that is repeated, along a straight line at constant speed."""

    stance_time: float = 0.3
    """[s]"""
    flight_time: float = 0.2
    """[s]"""
    speed: float = 0.4
    """[m/s]"""
    height: float = 0.24
    """Of the base when the feet touch down and lift off [m]."""
    foot_lift: float = 0.05
    """How high the feet are drawn up in the middle of the flight [m]."""

    @property
    def period(self) -> float:
        """Time from one landing to the next [s]."""
        return self.stance_time + self.flight_time

    @property
    def rise(self) -> float:
        """How far the base rises in flight [m]."""
        return GRAVITY * self.flight_time**2 / 8.0


def base_height(hop: Hop, time: Array) -> Array:
    """Return the height of the base [m]: a parabola in flight, half a sine wave in stance."""
    in_period = np.mod(time, hop.period)
    depth = 0.5 * GRAVITY * hop.flight_time * hop.stance_time / np.pi
    stance = hop.height - depth * np.sin(np.pi * np.minimum(in_period / hop.stance_time, 1.0))
    air = np.maximum(in_period - hop.stance_time, 0.0)
    return stance + 0.5 * GRAVITY * air * (hop.flight_time - air)


def foot_offset(hop: Hop, time: Array) -> Array:
    """Return the feet less the hips' places on the ground, forward and up [m], shape [num_frames, 2]."""
    in_period = np.mod(time, hop.period)
    reach = 0.5 * hop.speed * hop.stance_time
    backward = reach - hop.speed * np.minimum(in_period, hop.stance_time)
    air = np.clip((in_period - hop.stance_time) / hop.flight_time, 0.0, 1.0)
    # A cycloid: at both ends of the flight the feet move as the trunk does.
    share = air - np.sin(2.0 * np.pi * air) / (2.0 * np.pi)
    lift = 0.5 * hop.foot_lift * (1.0 - np.cos(2.0 * np.pi * air))
    return np.stack([backward + 2.0 * reach * share, lift], axis=-1)


def generate_hops(hop: Hop, num_frames: int) -> Array:
    """Return rows in Solo8's layout from a touch-down on, shape [num_frames, 33]."""
    step = 1.0 / Solo8.rate
    time = np.arange(num_frames, dtype=np.float64) * step
    rows = np.zeros((num_frames, NUM_COLUMNS))
    height, feet = base_height(hop, time), foot_offset(hop, time)
    rows[:, POSITION] = np.stack([hop.speed * time, np.zeros(num_frames), height], axis=-1)
    rows[:, QUATERNION] = [0.0, 0.0, 0.0, 1.0]
    rows[:, LINEAR_VELOCITY] = np.gradient(rows[:, POSITION], step, axis=0)
    rows[:, GRAVITY_DIRECTION] = [0.0, 0.0, -1.0]
    rows[:, HEIGHT] = height
    down = height - feet[:, 1]
    distance = np.hypot(feet[:, 0], down)
    direction = np.arctan2(-feet[:, 0], down)
    bend = 2.0 * np.arccos(distance / (2.0 * LEG_SEGMENT))
    for leg, side in enumerate(KNEE_SIDES):
        rows[:, JOINTS.start + 2 * leg] = direction + 0.5 * side * bend
        rows[:, JOINTS.start + 2 * leg + 1] = -side * bend
    rows[:, JOINT_SPEEDS] = np.gradient(rows[:, JOINTS], step, axis=0)
    return rows


def write_solo8(trajectories: Array, path: Path) -> None:
    """Write rows, shape [num_trajectories, num_frames, 33], as the tensor file that ``Solo8`` reads."""
    import torch

    with atomic_file(path) as temporary:
        torch.save(torch.tensor(trajectories, dtype=torch.float32), temporary)
