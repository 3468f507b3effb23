"""The same robot in plain MuJoCo, the C engine: one world at a time, to check the batched simulation against."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco as mujoco_package
import newton
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.model import FLOOR_FRICTION, build_solver, robot_builder
from kine2go_warp.env.simulation import Simulation
from kine2go_warp.robots import RobotSpec

mujoco: Any = mujoco_package
"""The package without its types: it names its compiled classes in a way that type checkers do not see."""

FIRST_DOF = 6
"""Velocities of the base come first."""


def mujoco_model(simulation: Simulation, config: EnvConfig) -> Any:
    """Return the model of one world for the C engine, with the same options.

    It is compiled by MuJoCo from what Newton read from the robot's URDF.
    """
    model = simulation.solver.mj_model
    model.opt.timestep = config.substep_duration
    return model


def position_driven_model(spec: RobotSpec, config: EnvConfig) -> Any:
    """Return the model for the C engine with the PD law as MuJoCo's own actuators, controlled by joint targets [rad].

    It differs from the environment in that the damping of the motors is integrated implicitly.
    """
    builder = robot_builder(spec, config.solver)
    for dof in range(FIRST_DOF, FIRST_DOF + 12):
        builder.joint_target_mode[dof] = int(newton.JointTargetMode.POSITION)
        builder.joint_target_ke[dof] = config.motor.stiffness
        builder.joint_target_kd[dof] = config.motor.damping
    scene = newton.ModelBuilder()
    scene.add_world(builder)
    scene.add_ground_plane(cfg=newton.ModelBuilder.ShapeConfig(mu=FLOOR_FRICTION, gap=0.0))
    model = build_solver(scene.finalize(device="cpu"), config).mj_model
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model.opt.timestep = config.substep_duration
    return model


@dataclass(frozen=True)
class MotorState:
    """The motors of one robot."""

    stiffness: NDArray
    """[N m/rad], shape [12]."""
    damping: NDArray
    """[N m s/rad], shape [12]."""
    strength: NDArray
    """Factor on the torque, shape [12]."""
    offset: NDArray
    """Error of the zero angle [rad], shape [12]."""
    delay: int
    """Latency [physics substeps]."""

    @classmethod
    def nominal(cls, config: EnvConfig) -> "MotorState":
        """Return what holds where nothing is drawn."""
        return cls(
            np.full(12, config.motor.stiffness),
            np.full(12, config.motor.damping),
            np.ones(12),
            np.zeros(12),
            config.delay_substeps,
        )


class MujocoRobot:
    """A robot driven by joint targets, as in the environment: PD law, latency and torque limits.

    States are in the environment's own form: ``joint_q`` (base origin [m], orientation x, y, z, w, joints [rad]),
    shape [19], and ``joint_qd`` (velocity of the base's centre of mass [m/s] and angular velocity [rad/s], both in the
    world frame, joint velocities [rad/s]), shape [18].
    """

    def __init__(
        self, simulation: Simulation, config: EnvConfig, spec: RobotSpec, motors: MotorState | None = None
    ) -> None:
        """Make the robot of world 0 of a simulation; its motors are nominal unless given."""
        self.model = mujoco_model(simulation, config)
        self.data = mujoco.MjData(self.model)
        self.substeps, self.effort = config.substeps, np.array(spec.joint_effort)
        self.motors = motors or MotorState.nominal(config)
        self.torque = np.zeros(12)
        self._targets: list[NDArray] = []

    @property
    def com_b(self) -> NDArray:
        """Centre of mass of the base, base frame [m]."""
        return np.array(self.model.body_ipos[1])

    def set_body(self, mass: float, com_b: NDArray, friction: float, geom_role: NDArray) -> None:
        """Give the robot another base, and friction with the ground.

        Args:
            mass: Of the base [kg]; its inertia grows in proportion.
            com_b: Its centre of mass [m].
            friction: Coefficient of friction.
            geom_role: What each shape is; those of the robot are not negative.
        """
        self.model.body_inertia[1] *= mass / self.model.body_mass[1]
        self.model.body_mass[1] = mass
        self.model.body_ipos[1] = com_b
        self.model.geom_friction[geom_role >= 0, 0] = friction
        mujoco.mj_setConst(self.model, self.data)

    def set_state(self, joint_q: NDArray, joint_qd: NDArray, targets: Sequence[NDArray] | None = None) -> None:
        """Place the robot.

        Args:
            joint_q: Coordinates.
            joint_qd: Velocities.
            targets: Joint targets that are on their way to the motors, one for each substep of the latency, the next
                one first; by default the motors hold the joints where they are.
        """
        orientation = Rotation.from_quat(np.asarray(joint_q[3:7], np.float64))
        angular = np.asarray(joint_qd[3:6], np.float64)
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:3] = joint_q[:3]
        self.data.qpos[3:7] = np.asarray(joint_q)[[6, 3, 4, 5]]
        self.data.qpos[7:] = joint_q[7:]
        self.data.qvel[:3] = joint_qd[:3] - np.cross(angular, orientation.apply(self.com_b))
        self.data.qvel[3:6] = orientation.inv().apply(angular)
        self.data.qvel[FIRST_DOF:] = joint_qd[6:]
        held = [np.asarray(joint_q[7:], np.float64)] * self.motors.delay
        self._targets = held if targets is None else [np.asarray(target, np.float64) for target in targets]

    def push(self, velocity: NDArray) -> None:
        """Add a velocity to the base [m/s], shape [3]."""
        self.data.qvel[:3] += velocity

    def state(self) -> tuple[NDArray, NDArray]:
        """Return ``joint_q`` and ``joint_qd``."""
        orientation = Rotation.from_quat(self.data.qpos[[4, 5, 6, 3]])
        angular = orientation.apply(self.data.qvel[3:6])
        linear = self.data.qvel[:3] + np.cross(angular, orientation.apply(self.com_b))
        joint_q = np.concatenate([self.data.qpos[:3], orientation.as_quat(), self.data.qpos[7:]])
        return joint_q, np.concatenate([linear, angular, self.data.qvel[FIRST_DOF:]])

    def step(self, joint_target: NDArray) -> None:
        """Advance by one control step with a joint target [rad], shape [12]."""
        motors = self.motors
        for _ in range(self.substeps):
            # One target a substep: the first in the queue was commanded the latency ago.
            self._targets.append(np.asarray(joint_target, np.float64))
            error = self._targets.pop(0) + motors.offset - self.data.qpos[7:]
            demand = motors.stiffness * error - motors.damping * self.data.qvel[FIRST_DOF:]
            self.torque = np.clip(motors.strength * demand, -self.effort, self.effort)
            self.data.qfrc_applied[FIRST_DOF:] = self.torque
            mujoco.mj_step(self.model, self.data)
