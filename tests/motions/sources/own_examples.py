"""The four files of the recipe ``own``, generated: ``python -m tests.motions.sources.own_examples FOLDER``."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from kine2go_warp.motions.body import GRAVITY
from kine2go_warp.motions.generator import PACE, DogGait, generate
from kine2go_warp.motions.keypoints import KEYPOINTS
from kine2go_warp.motions.sources.ai4animation import COLUMN_OF_KEYPOINT
from kine2go_warp.robots import GO2
from kine2go_warp.robots.kinematics import foot_positions, leg_angles
from tests.motions.sources.files import RATE, write_bvh, write_frames

STAND = replace(DogGait(), phases=(0.0, 0.0, 0.0, 0.0), stride_frames=100_000, speed=0.0, body_bob=0.0)
COLUMNS = [COLUMN_OF_KEYPOINT[name] for name in KEYPOINTS]
TRUNK, TOES = slice(0, 6), slice(6, 10)
"""Keypoints that move with the trunk, and the toes."""
SKELETON = ("Root", "Chest", "ArmL", "ArmR", "LegL", "LegR", "PawL", "PawR", "HindPawL", "HindPawR")
"""What the hound's skeleton calls the keypoints."""
PARENTS = {
    "Chest": "Root", "ArmL": "Chest", "ArmR": "Chest", "LegL": "Root", "LegR": "Root",
    "PawL": "ArmL", "PawR": "ArmR", "HindPawL": "LegL", "HindPawR": "LegR",
}  # fmt: skip


def write_hound(path):
    """A dog that trots in a wide circle, as a BVH skeleton with names of its own."""
    points = generate(DogGait(stride_frames=28, speed=0.9, turn_rate=0.3), 120).points
    named = {ours: points[:, column] for ours, column in zip(SKELETON, COLUMNS, strict=True)}
    return write_bvh(path, named, PARENTS)


def write_pace(path):
    """A Go2 that paces, as the 61 columns of AMP, legs in the order FR, FL, RR, RL."""
    gait = DogGait(phases=PACE, rate=RATE, stride_frames=24, speed=0.6, duty=0.58, body_bob=0.0, body_height=0.44)
    motion, size = generate(gait, 73), 0.72
    position = size * motion.trunk
    hips = np.array([np.add(leg.hip_offset, leg.thigh_offset) for leg in GO2.legs])
    under = generate(STAND, 1)
    beside = (
        motion.points[:, COLUMNS][:, TOES] - motion.trunk[:, None] - (under.points[0, COLUMNS][TOES] - under.trunk[0])
    )
    feet_b = size * beside + hips * [1.0, 1.0, 0.0]
    feet_b[..., 2] += GO2.foot_radius - position[:, None, 2]
    feet_b[..., 2] -= (feet_b[..., 2] + position[:, None, 2]).min() - GO2.foot_radius
    joints = leg_angles(GO2, feet_b)
    upright = np.tile([0.0, 0.0, 0.0, 1.0], (len(position), 1))
    order = [1, 0, 3, 2]
    legs = [values.reshape(-1, 4, 3)[:, order].reshape(-1, 12) for values in (joints, foot_positions(GO2, joints))]
    rows = np.concatenate([position, upright, *legs, np.zeros((len(position), 30))], axis=1)
    return write_frames(path, rows.round(5))


def write_sit(path):
    """A dog that stands, sits down, stays and stands up again, at 30 Hz."""
    points = generate(replace(STAND, rate=30.0), 135).points[:, COLUMNS]
    down = np.interp(np.arange(135), [25, 50, 80, 105], [0.0, 1.0, 1.0, 0.0])
    share = (1.0 - np.cos(np.pi * down)) / 2.0
    for name in ("pelvis", "RL_hip", "RR_hip"):
        point = KEYPOINTS.index(name)
        points[:, point, 2] -= share * (points[0, KEYPOINTS.index("RL_hip"), 2] - 0.06)
    return write_table(path, points, 30.0)


def write_leap(path):
    """A dog that crouches, leaps forward in free fall, lands and stands."""
    flight, speed = 0.3, 0.6
    lift_off = 0.5 * GRAVITY * flight
    times = [0.0, 0.5, 0.9, 1.05, 1.05 + flight, 1.6, 2.1, 2.6]
    up = CubicHermiteSpline(times, [0.0, 0.0, -0.1, 0.0, 0.0, -0.1, 0.0, 0.0], [0, 0, 0, lift_off, -lift_off, 0, 0, 0])
    along = CubicHermiteSpline(times, [0.0, 0.0, 0.0, 0.045, 0.225, 0.3, 0.3, 0.3], [0, 0, 0, speed, speed, 0, 0, 0])
    time = np.arange(157) / 60.0
    points = generate(STAND, len(time)).points[:, COLUMNS]
    points[:, TRUNK, 2] += up(time)[:, None]
    points[:, TRUNK, 0] += along(time)[:, None]
    share = np.clip((time - times[3]) / flight, 0.0, 1.0)
    points[:, TOES, 0] += 0.3 * (share - np.sin(2.0 * np.pi * share) / (2.0 * np.pi))[:, None]
    points[:, TOES, 2] += 0.08 * (0.5 - 0.5 * np.cos(2.0 * np.pi * share))[:, None]
    return write_table(path, points, 60.0)


def write_table(path, points, rate):
    """Write keypoints under our own names, three columns each, below a line of names."""
    header = ",".join(["time", *(f"{name}_{axis}" for name in KEYPOINTS for axis in "xyz")])
    rows = np.concatenate([np.arange(len(points))[:, None] / rate, points.reshape(len(points), -1)], axis=1)
    np.savetxt(path, rows, fmt=["%.6f", *["%.4f"] * 30], delimiter=",", header=header, comments="")
    return path


WRITERS = {"hound.bvh": write_hound, "pace.json": write_pace, "sit.csv": write_sit, "leap.csv": write_leap}

if __name__ == "__main__":
    for file, write in WRITERS.items():
        write(Path(sys.argv[1]) / file)
