"""A dataset of robots that walk as told: no simulation, so that every pose is known."""

from pathlib import Path

import numpy as np

from kine2go_warp.dataset.trajectories import Trajectories
from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.robots import GO2
from tests.dataset.test_store import SIMULATION, made_up

RATE = 60.0

FIDELITY = {
    "trunk_pitch": {"value": -0.55641, "units": "deg", "description": "pitch & <more>"},
    "flight_acceleration": {"value": None, "units": "m/s^2", "description": "while no foot stands"},
}
WALK = {"rejected": {"distance": 2}, "accepted": 3, "licence": "CC BY-NC 4.0", "citation": "One, 2018"}

MOTIONS = {
    "walk": (60, {**WALK, "fidelity": FIDELITY}),
    "stroll": (30, {"rejected": {}, "accepted": 3, "licence": "CC BY-SA 4.0", "citation": "Two & <b>Three</b>"}),
}
"""Rows and attributes of each motion."""


def write_walks(path: Path) -> Path:
    """Write the dataset."""
    rng = np.random.default_rng(0)
    for name, (rows, attributes) in MOTIONS.items():
        DatasetWriter(path, GO2).write(name, walking(rng, rows), SIMULATION, {"source": "made up", **attributes})
    return path


def walking(rng: np.random.Generator, rows: int) -> Trajectories:
    """Three trajectories: one straight, one that turns and is 5 rows shorter, one that speeds up far from the origin.

    Poses are as told, all else is noise; references are 0.1 m behind along the world's x axis.
    """
    data = made_up(rng, 3, rows)
    time = np.arange(rows) / RATE
    turn = np.stack([0.0 * time, 1.5 * time, 0.0 * time])
    forward = np.stack([1.0 * time, 0.5 * time, 2.0 * time**2])
    position = np.stack([forward * np.cos(turn), forward * np.sin(turn), np.full_like(turn, 0.32)], axis=-1)
    position[2, :, 1] += 3.0
    orientation = np.stack([np.cos(0.5 * turn), 0.0 * turn, 0.0 * turn, np.sin(0.5 * turn)], axis=-1)
    swing = 0.3 * np.sin(2.0 * np.pi * (2.0 * time[:, None] + np.arange(12) / 12))
    joints = np.stack([np.array(GO2.default_joint_position) + share * swing for share in (1.0, 0.8, 0.6)])
    poses = {"root_position": position, "root_orientation": orientation, "joint_position": joints}
    for name, values in poses.items():
        data.rows[name] = values.astype(np.float32)
        data.rows[f"reference_{name}"] = data.rows[name].copy()
    data.rows["reference_root_position"][..., 0] -= 0.1
    data.rows["reference_joint_position"] += np.float32([0.02, 0.01, 0.03])[:, None, None]
    data.rows["phase"] = np.tile(np.float32(2.0 * time % 1.0), (3, 1))
    return data
