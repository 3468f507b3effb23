"""Robots that follow recorded commands without a policy: the simulation of a rollout alone, as it was gathered."""

from dataclasses import replace
from typing import Any

import warp as wp
from numpy.typing import NDArray

from kine2go_warp.env.bodies import Bodies
from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.model import SpecArrays
from kine2go_warp.env.motors import Motors
from kine2go_warp.env.randomization import parameter_arrays
from kine2go_warp.env.simulation import Simulation
from kine2go_warp.env.terrain import build_height_field
from kine2go_warp.kernels import launch
from kine2go_warp.kernels.kinematics import link_states
from kine2go_warp.kernels.recording import record_root
from kine2go_warp.kernels.resets import advance_counters
from kine2go_warp.robots import RobotSpec

InitialState = dict[str, NDArray[Any]]
"""Arrays of ``INITIAL_STATE_ARRAYS``, the first axis of each being the trajectory."""


class OpenLoop:
    """Simulation and motors of some rollouts."""

    def __init__(
        self,
        spec: RobotSpec,
        config: EnvConfig,
        ground_reach: float,
        initial: InitialState,
        device: str,
        record_loads: bool = False,
    ) -> None:
        """Put the robots where the rollouts begin.

        Args:
            spec: The robot.
            config: The environment that the rollouts were gathered in.
            ground_reach: How far its ground reaches from the middle [m].
            initial: Where they begin.
            device: Where to simulate.
            record_loads: Whether to keep what ``loads`` returns.
        """
        num_worlds, queue_length = initial["target_queue"].shape[:2]
        self.config = replace(config, num_worlds=num_worlds)
        self.device = wp.get_device(device)
        with wp.ScopedDevice(self.device):
            ground = build_height_field(config.terrain, ground_reach)
            self.simulation = Simulation(spec, self.config, ground, self.device, record_loads)
            self.motors = Motors(self.config, SpecArrays.upload(spec, self.device))
            assert self.motors.target_queue.shape[1] == queue_length
            self.bodies = Bodies(self.config, self.simulation)
            self.reference_step = wp.zeros(num_worlds, dtype=int)
            self._root = [wp.zeros(num_worlds, dtype=kind) for kind in (wp.vec3, wp.vec4, wp.vec3, wp.vec3)]
            self._links = [wp.zeros((num_worlds, 16), dtype=kind) for kind in (wp.vec3, wp.vec4, wp.vec3, wp.vec3)]
            self._target = wp.zeros((num_worlds, 12), dtype=float)
            self._length = wp.zeros(num_worlds, dtype=wp.int64)
            # Once without a graph, so that modules are loaded and lazy allocations made.
            self._advance()
            with wp.ScopedCapture() as capture:
                self._advance()
            self._graph = capture.graph
            self._place(initial)

    def _place(self, initial: InitialState) -> None:
        """Write the initial state where the simulation reads it."""
        robot = self.simulation.robot
        targets = {
            "joint_q": robot.joint_q,
            "joint_qd": robot.joint_qd,
            "warm_start": self.simulation.warm_start,
            "target_queue": self.motors.target_queue,
            "reference_step": self.reference_step,
            **parameter_arrays(self.motors, self.bodies),
            "friction_anchor": self.motors.model.friction_anchor,
        }
        for name, array in targets.items():
            array.assign(initial[name])
        if self.config.draws_bodies:
            self.bodies.apply_bodies()
        self.bodies.apply_friction()

    def step(self, joint_target: NDArray[Any], push: NDArray[Any]) -> None:
        """Advance by one control step.

        Args:
            joint_target: Recorded joint targets [rad], shape [num_worlds, 12].
            push: Recorded pushes [m/s], shape [num_worlds, 3].
        """
        with wp.ScopedDevice(self.device):
            if push.any():
                joint_qd = self.simulation.robot.joint_qd.numpy().copy()
                joint_qd[:, :3] += push
                self.simulation.robot.joint_qd.assign(joint_qd)
            self._target.assign(joint_target)
            assert self._graph is not None
            wp.capture_launch(self._graph)

    def _advance(self) -> None:
        """Launch one control step."""
        self.motors.queue_targets(self._target, self.reference_step)
        self.simulation.advance(self.motors, self.reference_step)
        launch(advance_counters, dim=self.config.num_worlds, inputs=[self.reference_step, self._length])

    def state(self) -> dict[str, NDArray[Any]]:
        """Return the present state by the names of the dataset's arrays, the first axis being the world."""
        with wp.ScopedDevice(self.device):
            launch(record_root, dim=self.config.num_worlds, inputs=[self.simulation.robot, *self._root])
        names = ("root_position", "root_orientation", "root_linear_velocity", "root_angular_velocity")
        state = {name: array.numpy().copy() for name, array in zip(names, self._root, strict=True)}
        state["joint_position"] = self.simulation.robot.joint_q.numpy()[:, 7:].copy()
        state["joint_velocity"] = self.simulation.robot.joint_qd.numpy()[:, 6:].copy()
        return state

    def loads(self) -> dict[str, NDArray[Any]]:
        """Return mean power of the joints, forces on the feet, and place and velocity of the links; see ``Worlds``."""
        assert self.simulation.loads is not None
        with wp.ScopedDevice(self.device):
            inputs = [self.simulation.robot, self.simulation.geometry, *self._links]
            launch(link_states, dim=(self.config.num_worlds, 4, 4), inputs=inputs)
        return {
            "joint_power_mean": self.simulation.loads.power_mean.numpy().copy(),
            "foot_contact_force": self.simulation.foot_force.numpy().copy(),
            "link_position": self._links[0].numpy().copy(),
            "link_linear_velocity": self._links[2].numpy().copy(),
        }
