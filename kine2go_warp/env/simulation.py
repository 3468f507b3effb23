"""The physics of all worlds: Newton's model and solver, and the contacts read from it."""

from typing import Any

import kine2go_warp.kernels  # noqa: F401 - its settings of Warp come before Newton

# isort: split
import mujoco_warp
import newton
import numpy as np
import warp as wp
from numpy.typing import NDArray

from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.model import (
    base_com,
    build_model,
    build_solver,
    by_world,
    geom_roles,
    host_copy,
    leg_geometry,
)
from kine2go_warp.env.motors import Motors
from kine2go_warp.env.terrain import HeightField
from kine2go_warp.kernels import contacts, launch, loads
from kine2go_warp.kernels.coordinates import pull_state, push_state
from kine2go_warp.kernels.loads import StepLoads
from kine2go_warp.kernels.state import NUM_JOINTS, NUM_LEGS, RobotState
from kine2go_warp.metrics import SATURATION
from kine2go_warp.robots import RobotSpec

OVERFLOW_MASK = int(
    mujoco_warp.OverflowType.ALL & ~(mujoco_warp.OverflowType.ITERATIONS | mujoco_warp.OverflowType.LS_ITERATIONS)
)
"""The solver's warnings that mean dropped contacts or constraints; using all iterations is normal in a batch."""

GRAVITY = 9.81
"""[m/s^2]"""


class Simulation:
    """Steps the physics. States and contacts live in arrays that keep their addresses."""

    def __init__(
        self, spec: RobotSpec, config: EnvConfig, ground: HeightField, device: wp.Device, record_loads: bool = False
    ) -> None:
        """Build model and solver; all robots stand in the default pose.

        Args:
            spec: The robot.
            config: Settings.
            ground: The ground.
            device: Where to simulate.
            record_loads: Whether ``loads`` are kept, which costs some launches a substep.
        """
        self.config, self.num_worlds = config, config.num_worlds
        self.model = build_model(spec, config, ground, device)
        self.solver = build_solver(self.model, config)
        self.robot = RobotState()
        self.robot.joint_q = wp.clone(by_world(self.model.joint_q, self.num_worlds))
        self.robot.joint_qd = wp.clone(by_world(self.model.joint_qd, self.num_worlds))
        self.robot.com_b = wp.array(base_com(self.model, self.num_worlds), dtype=wp.vec3)
        self.geometry = leg_geometry(spec, device)
        self.geom_role = wp.array(geom_roles(self.model, self.solver, spec), dtype=int)
        self.robot_weight = float(host_copy(self.model.body_mass).sum()) / self.num_worlds * GRAVITY
        self.foot_force = wp.zeros((self.num_worlds, 4), dtype=wp.vec3)
        self.body_contact = wp.zeros(self.num_worlds, dtype=int)
        self.leg_contact = wp.zeros(self.num_worlds, dtype=int)
        self.loads = make_loads(self.num_worlds) if record_loads else None

    @property
    def data(self) -> Any:
        """MuJoCo Warp's own arrays."""
        return self.solver.mjw_data

    @property
    def overflow(self) -> wp.array[Any]:
        """The solver's warnings of all substeps since they were last cleared, shape [num_worlds]."""
        return self.data.overflow

    @property
    def warm_start(self) -> wp.array[Any]:
        """What the solver keeps from one step for the next, shape [num_worlds, 18]."""
        return self.data.qacc_warmstart

    def advance(self, motors: Motors, reference_step: wp.array[Any]) -> None:
        """Run the substeps of a control step.

        ``mujoco_warp.step`` is called directly: Newton's step also computes body poses and converts forces, which are
        not used here.
        """
        robot, data = self.robot, self.data
        for substep in range(self.config.substeps):
            motors.apply(substep, reference_step, robot.joint_q, robot.joint_qd, data.qfrc_applied)
            launch(push_state, dim=self.num_worlds, inputs=[robot, data.qpos, data.qvel])
            mujoco_warp.step(self.solver.mjw_model, data)
            if self.loads is not None:
                self.collect_contacts()
                when = [reference_step, substep, self.config.substeps, motors.model, SATURATION, self.loads]
                inputs = [motors.torque, robot.joint_qd, data.qvel, motors.target_queue, *when]
                launch(loads.add_joint_loads, dim=motors.torque.shape, inputs=inputs)
                inputs = [self.foot_force, substep, self.config.substeps, self.loads]
                launch(loads.add_foot_loads, dim=self.foot_force.shape, inputs=inputs)
            launch(pull_state, dim=self.num_worlds, inputs=[data.qpos, data.qvel, robot])

    def clear_loads(self) -> None:
        """Forget what the robots bore in an earlier life."""
        if self.loads is not None:
            for name in StepLoads.vars:
                getattr(self.loads, name).zero_()

    def rest(self, worlds: NDArray[np.bool_], joint_position: NDArray[np.float32]) -> None:
        """Let robots that were put elsewhere bear nothing yet, with motors that hold their joints.

        Args:
            worlds: Which ones, shape [num_worlds].
            joint_position: Of all worlds [rad], shape [num_worlds, 12].
        """
        write_worlds(self.leg_contact, worlds, np.zeros(self.num_worlds))
        if self.loads is not None:
            for name in StepLoads.vars:
                array = getattr(self.loads, name)
                values = joint_position if name == "applied_target" else np.zeros_like(array.numpy())
                write_worlds(array, worlds, values)

    def collect_contacts(self) -> None:
        """Read foot forces and other contacts of the last substep."""
        data = self.data
        results = [self.foot_force, self.body_contact, self.leg_contact]
        launch(contacts.clear_contacts, dim=self.num_worlds, inputs=results)
        launch(
            contacts.collect_contacts,
            dim=data.naconmax,
            inputs=[
                data.nacon,
                data.contact.geom,
                data.contact.worldid,
                data.contact.frame,
                data.contact.friction,
                data.contact.efc_address,
                data.efc.force,
                self.geom_role,
                *results,
            ],
        )

    def inertia_changed(self) -> None:
        """Tell the solver that masses in the model have changed."""
        self.solver.notify_model_changed(newton.ModelFlags.BODY_INERTIAL_PROPERTIES)


def write_worlds(array: wp.array[Any], worlds: NDArray[np.bool_], values: NDArray[Any]) -> None:
    """Write the values of some worlds, given by a mask; both arrays have all worlds along their first axis."""
    array.assign(np.where(worlds.reshape(-1, *(1,) * (values.ndim - 1)), values, array.numpy()))


def make_loads(num_worlds: int) -> StepLoads:  # pyright: ignore[reportGeneralTypeIssues] - a Warp struct
    """Return loads that are zero."""
    made = StepLoads()
    for name in StepLoads.vars:
        size, kind = (NUM_LEGS if name.startswith("force") else NUM_JOINTS), wp.vec3 if name == "force_mean" else float
        setattr(made, name, wp.zeros((num_worlds, int(size)), dtype=kind))
    return made
