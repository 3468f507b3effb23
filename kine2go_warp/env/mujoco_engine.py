"""The same robot in plain MuJoCo, the C engine: one world at a time, to check the batched simulation against.

Its model is compiled by MuJoCo itself from URDF and ``RobotSpec``; nothing of Newton's importer is in it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from kine2go_warp.env.config import EnvConfig
from kine2go_warp.machine import package_versions
from kine2go_warp.metrics import SATURATION
from kine2go_warp.robots import MotorLimits, RobotSpec
from kine2go_warp.robots.compiled import mujoco, robot_tree
from kine2go_warp.robots.spec import FRICTION_DAMPING, FRICTION_STIFFNESS

FIRST_DOF = 6
"""Velocities of the base come first."""

FLOOR_FRICTION = 1e-3
"""Contacts use the larger coefficient of the two shapes, so that the robot's alone counts."""


SIMULATION_RULES = {
    "base": "initial_state/base_mass and base_com replace those of the base link; its inertia grows with its mass",
    "contact": "the coefficient of a contact is the larger of its two shapes', so that initial_state/friction counts",
    "motors": "torque = strength * (stiffness * (target + motor_offset - position) - damping * velocity), kept within "
    "motor_limits: against the motion within braking; with it within driving, which falls from full_torque_speed to "
    "none at no_load_speed",
    "joint_friction": "a spring and damper whose torque is at most joint_friction; beyond that its anchor slides along",
    "order": "before each substep motors and friction are computed from the state that it begins with; a push is added "
    "to the base's velocity before the first substep",
    "latency": "in substep s of row t the target of row t + floor((s - delay) / substeps) is in force",
    "queue": "initial_state/target_queue holds the target of control step k, counted as reference_step is, in slot "
    "k modulo its length",
}
"""How the numbers of a simulation record are used."""


def world_tree(spec: RobotSpec, config: EnvConfig) -> Any:
    """Return the robot on a plane with the solver's options, as MuJoCo's editable specification."""
    solver, tree = config.solver, robot_tree(spec)
    for name in spec.joint_names:
        tree.joint(name).solref_limit = [solver.stop_time, 1.0]
    for geom in tree.geoms:
        geom.friction[0] = solver.friction
        geom.contype, geom.conaffinity = 1, int(solver.self_contact)
    tree.worldbody.add_geom(
        name="ground",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[5.0, 5.0, 5.0],
        friction=[FLOOR_FRICTION, 0.005, 0.0001],
        contype=0,
        conaffinity=1,
    )
    option = tree.option
    option.timestep = config.substep_duration
    option.iterations, option.ls_iterations = solver.iterations, solver.line_search_iterations
    option.tolerance = solver.tolerance
    # Joints have no damping that Euler's integrator would have to solve for.
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP)
    return tree


def robot_xml(spec: RobotSpec, config: EnvConfig) -> str:
    """Return the robot on a plane with the solver's options as MJCF."""
    tree = world_tree(spec, config)
    tree.compile()
    return tree.to_xml()


def simulation_record(spec: RobotSpec, config: EnvConfig) -> dict[str, Any]:
    """Return what is needed besides ``robot_xml`` to simulate the robot without this package.

    Numbers are read from the compiled model, so that they are those of ``robot_xml``.
    """
    model = mujoco_model(spec, config)
    option, joint, ground = model.opt, model.joint(spec.joint_names[0]), model.geom("ground")
    return {
        "engine": "MuJoCo Warp through Newton, in single precision",
        "packages": package_versions(),
        "timestep": config.substep_duration,
        "substeps": config.substeps,
        "integrator": mujoco.mjtIntegrator(option.integrator).name,
        "implicit_joint_damping": False,
        "solver": mujoco.mjtSolver(option.solver).name,
        "cone": mujoco.mjtCone(option.cone).name,
        "iterations": int(option.iterations),
        "line_search_iterations": int(option.ls_iterations),
        "tolerance": float(option.tolerance),
        "gravity": option.gravity.tolist(),
        "ground": config.terrain.kind,
        "contact_dimensions": int(ground.condim[0]),
        "contact_solref": ground.solref.tolist(),
        "contact_solimp": ground.solimp.tolist(),
        "self_contact": config.solver.self_contact,
        "base_link": spec.base_link,
        "armature": spec.armature,
        "joint_lower": list(spec.joint_lower),
        "joint_upper": list(spec.joint_upper),
        "stop_solref": model.jnt_solref[joint.id].tolist(),
        "motor_limits": {name: list(values) for name, values in vars(config.motor.limits(spec)).items()},
        "friction_stiffness": FRICTION_STIFFNESS,
        "friction_damping": FRICTION_DAMPING,
        "rules": SIMULATION_RULES,
    }


def mujoco_model(spec: RobotSpec, config: EnvConfig) -> Any:
    """Return the model of one world for the C engine, with the options of the batched solver."""
    return world_tree(spec, config).compile()


def position_driven_model(spec: RobotSpec, config: EnvConfig) -> Any:
    """Return the model for the C engine with the PD law as MuJoCo's own actuators, controlled by joint targets [rad].

    It differs from the environment in that the damping of the motors is integrated implicitly, in that the joints'
    friction is a row of the solver, and in that torque limits do not depend on the speed.
    """
    tree = world_tree(spec, config)
    tree.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    stiffness, damping = config.motor.gains(spec)
    for name, friction in zip(spec.joint_names, config.motor.joint_friction(spec), strict=True):
        tree.joint(name).frictionloss = friction
        actuator = tree.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        actuator.set_to_position(kp=stiffness, kv=damping)
    return tree.compile()


@dataclass(frozen=True)
class MotorState:
    """The motors of one robot."""

    stiffness: NDArray[Any]
    """[N m/rad], shape [12]."""
    damping: NDArray[Any]
    """[N m s/rad], shape [12]."""
    strength: NDArray[Any]
    """Factor on the torque, shape [12]."""
    offset: NDArray[Any]
    """Error of the zero angle [rad], shape [12]."""
    delay: int
    """Latency [physics substeps]."""
    limits: MotorLimits
    """Largest torques."""
    friction: NDArray[Any]
    """Coulomb friction of the joints [N m], shape [12]."""

    @classmethod
    def nominal(cls, config: EnvConfig, spec: RobotSpec) -> "MotorState":
        """Return what holds where nothing is drawn."""
        stiffness, damping = config.motor.gains(spec)
        return cls(
            np.full(12, stiffness),
            np.full(12, damping),
            np.ones(12),
            np.zeros(12),
            config.delay_substeps,
            config.motor.limits(spec),
            np.array(config.motor.joint_friction(spec)),
        )


class MujocoRobot:
    """A robot driven by joint targets, as in the environment: PD law, latency, torque limits and joint friction.

    States are in the environment's own form: ``joint_q`` (base origin [m], orientation x, y, z, w, joints [rad]),
    shape [19], and ``joint_qd`` (velocity of the base's centre of mass [m/s] and angular velocity [rad/s], both in the
    world frame, joint velocities [rad/s]), shape [18].
    """

    def __init__(self, config: EnvConfig, spec: RobotSpec, motors: MotorState | None = None) -> None:
        """Compile the robot; its motors are nominal unless given."""
        self.model = mujoco_model(spec, config)
        self.data = mujoco.MjData(self.model)
        self.substeps = config.substeps
        self.motors = motors or MotorState.nominal(config, spec)
        self.torque, self.friction_anchor = np.zeros(12), np.zeros(12)
        self.torque_at_limit, self.joint_power = np.zeros(12), np.zeros(12)
        """Of the last control step: share of substeps with the motor at its limit, mean power [W], shape [12] each."""
        self.base = self.model.body(spec.base_link).id
        self._targets: list[NDArray[Any]] = []

    @property
    def com_b(self) -> NDArray[Any]:
        """Centre of mass of the base, base frame [m]."""
        return np.array(self.model.body_ipos[self.base])

    @property
    def touches_ground(self) -> bool:
        """Whether base or head touches the ground."""
        bodies = self.model.geom_bodyid[self.data.contact.geom[self.data.contact.efc_address >= 0]]
        return bool((np.sort(bodies, axis=-1) == (0, self.base)).all(axis=-1).any())

    def set_body(self, mass: float, com_b: NDArray[Any], friction: float) -> None:
        """Give the robot another base, and friction with the ground.

        Args:
            mass: Of the base [kg]; its inertia grows in proportion.
            com_b: Its centre of mass [m].
            friction: Coefficient of friction.
        """
        self.model.body_inertia[self.base] *= mass / self.model.body_mass[self.base]
        self.model.body_mass[self.base] = mass
        self.model.body_ipos[self.base] = com_b
        self.model.geom_friction[self.model.geom_bodyid > 0, 0] = friction
        mujoco.mj_setConst(self.model, self.data)

    def set_state(
        self,
        joint_q: NDArray[Any],
        joint_qd: NDArray[Any],
        targets: Sequence[NDArray[Any]] | None = None,
        friction_anchor: NDArray[Any] | None = None,
    ) -> None:
        """Place the robot.

        Args:
            joint_q: Coordinates.
            joint_qd: Velocities.
            targets: Joint targets that are on their way to the motors, one for each substep of the latency, the next
                one first; by default the motors hold the joints where they are.
            friction_anchor: Joint positions at which the springs of the friction are slack [rad], shape [12]; by
                default those of the robot.
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
        self.torque, self.torque_at_limit, self.joint_power = np.zeros((3, 12))
        anchor = joint_q[7:] if friction_anchor is None else friction_anchor
        self.friction_anchor = np.array(anchor, np.float64)
        self._targets = held if targets is None else [np.asarray(target, np.float64) for target in targets]

    def push(self, velocity: NDArray[Any]) -> None:
        """Add a velocity to the base [m/s], shape [3]."""
        self.data.qvel[:3] += velocity

    def state(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return ``joint_q`` and ``joint_qd``."""
        orientation = Rotation.from_quat(self.data.qpos[[4, 5, 6, 3]])
        angular = orientation.apply(self.data.qvel[3:6])
        linear = self.data.qvel[:3] + np.cross(angular, orientation.apply(self.com_b))
        joint_q = np.concatenate([self.data.qpos[:3], orientation.as_quat(), self.data.qpos[7:]])
        return joint_q, np.concatenate([linear, angular, self.data.qvel[FIRST_DOF:]])

    def step(self, joint_target: NDArray[Any]) -> None:
        """Advance by one control step with a joint target [rad], shape [12]."""
        motors = self.motors
        self.torque_at_limit, self.joint_power = np.zeros((2, 12))
        for _ in range(self.substeps):
            # One target a substep: the first in the queue was commanded the latency ago.
            self._targets.append(np.asarray(joint_target, np.float64))
            error = self._targets.pop(0) + motors.offset - self.data.qpos[7:]
            self.drive(motors.strength * (motors.stiffness * error - motors.damping * self.data.qvel[FIRST_DOF:]))

    def drive(self, torque: NDArray[Any]) -> None:
        """Advance by one physics step with torques that the motors give as far as they can [N m], shape [12]."""
        motors, reach = self.motors, self.motors.friction / FRICTION_STIFFNESS
        position, velocity = self.data.qpos[7:].copy(), self.data.qvel[FIRST_DOF:].copy()
        limit = motors.limits.available(torque, velocity)
        self.torque = np.clip(torque, -limit, limit)
        stretch = np.clip(position - self.friction_anchor, -reach, reach)
        self.friction_anchor = position - stretch
        friction = -FRICTION_STIFFNESS * stretch - FRICTION_DAMPING * velocity
        friction = np.clip(friction, -motors.friction, motors.friction)
        self.data.qfrc_applied[FIRST_DOF:] = self.torque + friction
        mujoco.mj_step(self.model, self.data)
        self.torque_at_limit += (np.abs(self.torque) >= SATURATION * limit) / self.substeps
        self.joint_power += self.torque * self.data.qvel[FIRST_DOF:] / self.substeps
