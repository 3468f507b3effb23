"""Whether a dataset's trajectories come out again when their commands are repeated."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.motion import MotionData
from kine2go_warp.errors import DatasetError
from kine2go_warp.rollouts.worlds import STATES, Engine, Scene, Worlds
from kine2go_warp.rotations import rotation_angle

HORIZONS = (0.25, 0.5, 1.0, 2.0)
"""Times at which the distance between replay and record is reported [s]."""


@dataclass(frozen=True)
class ReplayResult:
    """How a replay compares with the record of one trajectory."""

    trajectory: int
    num_rows: int
    first_difference: int | None
    """First row that is not the same bit for bit, none if all are."""
    root_difference: tuple[float, ...]
    """Largest distance of the roots up to each of ``HORIZONS`` and to the end [m], NaN beyond the end."""
    angle_difference: tuple[float, ...]
    """Largest angle between the roots [rad]."""
    joint_difference: tuple[float, ...]
    """Largest difference of a joint position [rad]."""

    @property
    def is_identical(self) -> bool:
        """Whether every row came out bit for bit."""
        return self.first_difference is None


def replay_motion(
    path: Path, motion: str, trajectories: list[int] | None, engine: Engine, device: str
) -> list[ReplayResult]:
    """Restore the initial states of trajectories, repeat their commands, and compare.

    Args:
        path: The dataset.
        motion: The motion.
        trajectories: Which ones, by default all. Each is simulated in a world of its own, one world at a time.
        engine: ``newton`` for the simulation that the data come from, ``mujoco`` for plain MuJoCo.
        device: Where Newton simulates.

    Raises:
        DatasetError: the dataset cannot be read, or there is no such trajectory.
    """
    dataset = open_dataset(path, include_rejected=True)
    dataset = dataset.select([motion], where=lambda one: not one.values["reason"])
    data, spec = dataset.load(motion), dataset.robot
    count = data.trajectories.num_trajectories
    chosen = list(range(count)) if trajectories is None else trajectories
    for index in chosen:
        if not 0 <= index < count:
            raise DatasetError(f"{path}/{motion}: has trajectories 0 to {count - 1}, not {index}")
    scene = Scene.of(path, data, spec)
    return [
        compare(data, index, replay(scene.chosen([index]).open(engine, device), data, index), scene.config.control_rate)
        for index in chosen
    ]


def replay(worlds: Worlds, data: MotionData, index: int) -> dict[str, NDArray[Any]]:
    """Return the states of a trajectory, each of shape [num_rows, ...], when its recorded commands are repeated.

    Args:
        worlds: One world, where the trajectory begins.
        data: The record.
        index: The trajectory's place in it.
    """
    rows, length = data.trajectories.rows, int(data.trajectories.draws["length"][index])
    seen = [worlds.state()]
    for row in range(length - 1):
        worlds.step(rows["joint_target"][index : index + 1, row], rows["push"][index : index + 1, row])
        seen.append(worlds.state())
    return {name: np.stack([state[name][0] for state in seen]) for name in STATES}


def compare(data: MotionData, index: int, replayed: dict[str, NDArray[Any]], control_rate: float) -> ReplayResult:
    """Compare a replay with the record."""
    length = int(data.trajectories.draws["length"][index])
    recorded = {name: data.trajectories.rows[name][index, :length] for name in STATES}
    differs = np.zeros(length, dtype=bool)
    for name in STATES:
        one, other = recorded[name], replayed[name].astype(np.float32)
        if name == "root_orientation":
            # The record flips signs to be continuous in time.
            other = np.where(np.sum(one * other, axis=-1, keepdims=True) < 0.0, -other, other)
        differs |= (one != other).any(axis=-1)
    root = np.linalg.norm(recorded["root_position"] - replayed["root_position"], axis=-1)
    angle = rotation_angle(recorded["root_orientation"], replayed["root_orientation"])
    joint = np.abs(recorded["joint_position"] - replayed["joint_position"]).max(axis=-1)
    ends = [round(horizon * control_rate) + 1 for horizon in HORIZONS]

    def largest(values: NDArray[Any]) -> tuple[float, ...]:
        within = [float(values[:end].max()) if end <= length else float("nan") for end in ends]
        return (*within, float(values.max()))

    first = int(np.argmax(differs)) if differs.any() else None
    return ReplayResult(index, length, first, largest(root), largest(angle), largest(joint))
