"""The same robot in plain MuJoCo, the C engine: one world at a time, to check the batched simulation against."""

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


class MujocoRobot:
    """A robot driven by joint targets, as in the environment: PD law, latency and torque limits.

    States are in the environment's own form: ``joint_q`` (base origin [m], orientation x, y, z, w, joints [rad]),
    shape [19], and ``joint_qd`` (velocity of the base's centre of mass [m/s] and angular velocity [rad/s], both in the
    world frame, joint velocities [rad/s]), shape [18].
    """

    def __init__(self, simulation: Simulation, config: EnvConfig, spec: RobotSpec) -> None:
        """Make the robot of world 0 of a simulation; motors are those of the settings, nothing being drawn."""
        self.model = mujoco_model(simulation, config)
        self.data = mujoco.MjData(self.model)
        self.config, self.effort = config, np.array(spec.joint_effort)
        self.com_b = np.array(self.model.body_ipos[1])
        self.torque = np.zeros(12)
        self._targets: list[NDArray] = []

    def set_state(self, joint_q: NDArray, joint_qd: NDArray) -> None:
        """Place the robot; its motors hold the joints where they are."""
        orientation = Rotation.from_quat(np.asarray(joint_q[3:7], np.float64))
        angular = np.asarray(joint_qd[3:6], np.float64)
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:3] = joint_q[:3]
        self.data.qpos[3:7] = np.asarray(joint_q)[[6, 3, 4, 5]]
        self.data.qpos[7:] = joint_q[7:]
        self.data.qvel[:3] = joint_qd[:3] - np.cross(angular, orientation.apply(self.com_b))
        self.data.qvel[3:6] = orientation.inv().apply(angular)
        self.data.qvel[FIRST_DOF:] = joint_qd[6:]
        self._targets = [np.asarray(joint_q[7:], np.float64)] * self.config.delay_substeps

    def state(self) -> tuple[NDArray, NDArray]:
        """Return ``joint_q`` and ``joint_qd``."""
        orientation = Rotation.from_quat(self.data.qpos[[4, 5, 6, 3]])
        angular = orientation.apply(self.data.qvel[3:6])
        linear = self.data.qvel[:3] + np.cross(angular, orientation.apply(self.com_b))
        joint_q = np.concatenate([self.data.qpos[:3], orientation.as_quat(), self.data.qpos[7:]])
        return joint_q, np.concatenate([linear, angular, self.data.qvel[FIRST_DOF:]])

    def step(self, joint_target: NDArray) -> None:
        """Advance by one control step with a joint target [rad], shape [12]."""
        motor = self.config.motor
        for _ in range(self.config.substeps):
            # One target a substep: the first in the queue was commanded the latency ago.
            self._targets.append(np.asarray(joint_target, np.float64))
            target = self._targets.pop(0)
            demand = motor.stiffness * (target - self.data.qpos[7:]) - motor.damping * self.data.qvel[FIRST_DOF:]
            self.torque = np.clip(demand, -self.effort, self.effort)
            self.data.qfrc_applied[FIRST_DOF:] = self.torque
            mujoco.mj_step(self.model, self.data)
