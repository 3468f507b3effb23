"""Whether a dataset's trajectories come out again when their commands are repeated."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import zarr
from numpy.typing import NDArray

from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.motion import MotionData
from kine2go_warp.dataset.schema import INITIAL_STATE_ARRAYS
from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.mujoco_engine import MotorState, MujocoRobot
from kine2go_warp.errors import DatasetError
from kine2go_warp.robots import RobotSpec
from kine2go_warp.rollouts.open_loop import InitialState, OpenLoop
from kine2go_warp.rotations import rotation_angle
from kine2go_warp.settings import from_dictionary

Engine = Literal["newton", "mujoco"]

HORIZONS = (0.25, 0.5, 1.0, 2.0)
"""Times at which it is told how far replay and record have parted [s]."""

FRICTION = ("joint_friction", "friction_anchor")
"""Parts of the initial state that older datasets lack: their joints had no friction."""

STATES = (
    "root_position",
    "root_orientation",
    "root_linear_velocity",
    "root_angular_velocity",
    "joint_position",
    "joint_velocity",
)
"""Arrays that are compared."""


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
    config = environment_config(data.attributes, f"{path}/{motion}")
    initial = read_initial_state(path, motion)
    reach = float(data.attributes.get("ground_reach", 0.0))
    run = replay_in_newton if engine == "newton" else replay_in_mujoco
    return [
        compare(data, index, run(data, index, spec, config, reach, one_of(initial, index), device), config.control_rate)
        for index in chosen
    ]


def environment_config(attributes: dict[str, Any], where: str) -> EnvConfig:
    """Return the environment that a motion was gathered in.

    Raises:
        DatasetError: the attributes do not tell.
    """
    if "environment_settings" not in attributes:
        raise DatasetError(f"{where}: does not say how it was simulated (no environment_settings); gather it again")
    return from_dictionary(EnvConfig, attributes["environment_settings"], where, DatasetError)


def read_initial_state(path: Path, motion: str) -> InitialState:
    """Read the initial states of all trajectories.

    Raises:
        DatasetError: one of the arrays is missing or damaged.
    """
    group = zarr.open_group(path / motion, mode="r")
    state = {}
    for array in INITIAL_STATE_ARRAYS:
        name = f"initial_state/{array.name}"
        if array.name in FRICTION and name not in group:
            continue
        try:
            state[array.name] = np.asarray(group[name][...])  # pyright: ignore[reportArgumentType, reportIndexIssue]
        except Exception as error:  # noqa: BLE001 - codecs and stores raise errors of many kinds
            raise DatasetError(f"{path}/{motion}/{name}: cannot be read ({error.__class__.__name__})") from None
    position = state["joint_q"][:, 7:]
    return dict(zip(FRICTION, (np.zeros_like(position), position), strict=True)) | state


def one_of(initial: InitialState, index: int) -> InitialState:
    """Return the initial state of one trajectory."""
    return {name: values[index : index + 1] for name, values in initial.items()}


def replay_in_newton(
    data: MotionData,
    index: int,
    spec: RobotSpec,
    config: EnvConfig,
    reach: float,
    initial: InitialState,
    device: str,
) -> dict[str, NDArray[Any]]:
    """Return the states of a trajectory simulated anew, each of shape [num_rows, ...]."""
    rows, length = data.trajectories.rows, int(data.trajectories.draws["length"][index])
    robot = OpenLoop(spec, config, reach, initial, device)
    seen = [robot.state()]
    for row in range(length - 1):
        robot.step(rows["joint_target"][index : index + 1, row], rows["push"][index : index + 1, row])
        seen.append(robot.state())
    return {name: np.stack([state[name][0] for state in seen]) for name in STATES}


def replay_in_mujoco(
    data: MotionData,
    index: int,
    spec: RobotSpec,
    config: EnvConfig,
    reach: float,  # noqa: ARG001 - the ground is a plane
    initial: InitialState,
    device: str,  # noqa: ARG001 - MuJoCo runs on the CPU
) -> dict[str, NDArray[Any]]:
    """Return the same from plain MuJoCo, whose model is compiled from URDF and specification.

    Raises:
        DatasetError: the ground is not flat.
    """
    if not config.terrain.is_flat:
        raise DatasetError("plain MuJoCo replays flat ground only; leave --engine out")
    rows, length = data.trajectories.rows, int(data.trajectories.draws["length"][index])
    names = ("stiffness", "damping", "strength", "motor_offset", "joint_friction")
    stiffness, damping, strength, offset, friction = (initial[name][0].astype(float) for name in names)
    delay, limits = int(initial["delay"][0]), config.motor.limits(spec)
    robot = MujocoRobot(config, spec, MotorState(stiffness, damping, strength, offset, delay, limits, friction))
    robot.set_body(float(initial["base_mass"][0]), initial["base_com"][0], float(initial["friction"][0]))
    targets = coming_targets(initial, config.substeps)
    robot.set_state(initial["joint_q"][0], initial["joint_qd"][0], targets, initial["friction_anchor"][0])
    states = [robot.state()]
    for row in range(length - 1):
        robot.push(rows["push"][index, row])
        robot.step(rows["joint_target"][index, row])
        states.append(robot.state())
    joint_q, joint_qd = (np.array(values) for values in zip(*states, strict=True))
    return {
        "root_position": joint_q[:, :3],
        "root_orientation": joint_q[:, [6, 3, 4, 5]],
        "root_linear_velocity": joint_qd[:, :3],
        "root_angular_velocity": joint_qd[:, 3:6],
        "joint_position": joint_q[:, 7:],
        "joint_velocity": joint_qd[:, 6:],
    }


def coming_targets(initial: InitialState, substeps: int) -> list[NDArray[Any]]:
    """Return the targets on their way to the motors, one a substep of the latency, the next one first."""
    queue, step, delay = initial["target_queue"][0], int(initial["reference_step"][0]), int(initial["delay"][0])
    steps = [(step * substeps + substep - delay) // substeps for substep in range(delay)]
    return [queue[place % len(queue)] for place in steps]


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
