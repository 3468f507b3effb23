"""Robots that begin where trajectories of a dataset begin and follow joint targets, in Newton or in plain MuJoCo."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
import zarr
from numpy.typing import NDArray

from kine2go_warp.dataset.motion import MotionData
from kine2go_warp.dataset.schema import INITIAL_STATE_ARRAYS
from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.mujoco_engine import MotorState, MujocoRobot
from kine2go_warp.errors import DatasetError
from kine2go_warp.robots import RobotSpec
from kine2go_warp.rollouts.open_loop import InitialState, OpenLoop
from kine2go_warp.settings import from_dictionary

Engine = Literal["newton", "mujoco"]

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
"""The state of a robot, by the names of the dataset's arrays."""


class Worlds(Protocol):
    """One robot a world; the first axis of all arrays is the world."""

    def state(self) -> dict[str, NDArray[Any]]:
        """Return the arrays of ``STATES``."""
        ...

    def loads(self) -> dict[str, NDArray[Any]]:
        """Return what the last control step took: ``joint_power_mean``, and what else the engine tells."""
        ...

    def step(self, joint_target: NDArray[Any], push: NDArray[Any]) -> None:
        """Advance by one control step.

        Args:
            joint_target: [rad], shape [num_worlds, 12].
            push: Added to the velocity of the bases [m/s], shape [num_worlds, 3].
        """
        ...


@dataclass(frozen=True)
class Scene:
    """Where the trajectories of one motion begin, and what their worlds are like."""

    spec: RobotSpec
    config: EnvConfig
    ground_reach: float
    """How far the ground reaches from the middle [m]."""
    initial: InitialState

    @classmethod
    def of(cls, path: Path, data: MotionData, spec: RobotSpec) -> "Scene":
        """Read it for some trajectories of a dataset.

        Args:
            path: The dataset.
            data: The trajectories.
            spec: The robot.

        Raises:
            DatasetError: the dataset does not tell how it was simulated, or an array is missing or damaged.
        """
        config = environment_config(data.attributes, f"{path}/{data.name}")
        reach = float(data.attributes.get("ground_reach", 0.0))
        scene = cls(spec, config, reach, read_initial_state(path, data.name))
        return scene.chosen(data.indices)

    def chosen(self, indices: Sequence[int] | NDArray[Any]) -> "Scene":
        """Return the scene of some of the trajectories."""
        rows = np.asarray(indices)
        initial = {name: values[rows] for name, values in self.initial.items()}
        return Scene(self.spec, self.config, self.ground_reach, initial)

    def open(self, engine: Engine, device: str, record_loads: bool = False) -> Worlds:
        """Put the robots where their trajectories begin.

        Args:
            engine: ``newton`` for the simulation that the data come from, ``mujoco`` for plain MuJoCo.
            device: Where Newton simulates.
            record_loads: Whether Newton keeps what ``Worlds.loads`` returns.

        Raises:
            DatasetError: plain MuJoCo does not have this ground.
        """
        if engine == "mujoco":
            return MujocoWorlds(self)
        return OpenLoop(self.spec, self.config, self.ground_reach, self.initial, device, record_loads)


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


class MujocoWorlds:
    """Robots in plain MuJoCo, whose models are compiled from URDF and specification."""

    def __init__(self, scene: Scene) -> None:
        """Compile a robot for each trajectory.

        Raises:
            DatasetError: the ground is not flat.
        """
        if not scene.config.terrain.is_flat:
            raise DatasetError("plain MuJoCo has flat ground only; leave --engine out")
        self.robots = [placed_robot(scene, index) for index in range(len(scene.initial["joint_q"]))]

    def state(self) -> dict[str, NDArray[Any]]:
        """See ``Worlds.state``."""
        states = [robot.state() for robot in self.robots]
        joint_q, joint_qd = (np.array(values) for values in zip(*states, strict=True))
        return {
            "root_position": joint_q[:, :3],
            "root_orientation": joint_q[:, [6, 3, 4, 5]],
            "root_linear_velocity": np.array([robot.data.qvel[:3] for robot in self.robots]),
            "root_angular_velocity": joint_qd[:, 3:6],
            "joint_position": joint_q[:, 7:],
            "joint_velocity": joint_qd[:, 6:],
        }

    def loads(self) -> dict[str, NDArray[Any]]:
        """See ``Worlds.loads``."""
        return {"joint_power_mean": np.array([robot.joint_power for robot in self.robots])}

    def step(self, joint_target: NDArray[Any], push: NDArray[Any]) -> None:
        """See ``Worlds.step``."""
        for robot, target, velocity in zip(self.robots, joint_target, push, strict=True):
            robot.push(velocity)
            robot.step(target)


def placed_robot(scene: Scene, index: int) -> MujocoRobot:
    """Return the robot of one trajectory in plain MuJoCo."""
    initial = {name: values[index] for name, values in scene.initial.items()}
    names = ("stiffness", "damping", "strength", "motor_offset", "joint_friction")
    stiffness, damping, strength, offset, friction = (initial[name].astype(float) for name in names)
    delay, limits = int(initial["delay"]), scene.config.motor.limits(scene.spec)
    motors = MotorState(stiffness, damping, strength, offset, delay, limits, friction)
    robot = MujocoRobot(scene.config, scene.spec, motors)
    robot.set_body(float(initial["base_mass"]), initial["base_com"], float(initial["friction"]))
    targets = coming_targets(initial, scene.config.substeps)
    robot.set_state(initial["joint_q"], initial["joint_qd"], targets, initial["friction_anchor"])
    return robot


def coming_targets(initial: dict[str, NDArray[Any]], substeps: int) -> list[NDArray[Any]]:
    """Return the targets on their way to one robot's motors, one a substep of the latency, the next one first."""
    queue, step, delay = initial["target_queue"], int(initial["reference_step"]), int(initial["delay"])
    steps = [(step * substeps + substep - delay) // substeps for substep in range(delay)]
    return [queue[place % len(queue)] for place in steps]
