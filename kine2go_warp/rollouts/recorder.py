"""Takes rows of state and action off the device without slowing it down."""

from typing import Any

import torch
import warp as wp
from numpy.typing import NDArray

from kine2go_warp.dataset.schema import FINAL_STATE_ARRAYS
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.model import body_shapes
from kine2go_warp.kernels import launch
from kine2go_warp.kernels.kinematics import link_states
from kine2go_warp.kernels.leg_distance import least_leg_distance
from kine2go_warp.kernels.recording import record_reference, record_root
from kine2go_warp.kernels.reference import sample_reference
from kine2go_warp.metrics import CONTACT_FORCE
from kine2go_warp.rollouts.row_writer import RowStore

MOST_ROWS_ON_DEVICE = 128
"""Rows buffered on the device before they are given to the writer, of few worlds."""

BYTES_ON_DEVICE = 64_000_000
"""About what is buffered of many worlds. A few such blocks wait for the disk in the host's page-locked memory."""

BYTES_OF_ROW = 2000
"""About what a row of a world takes."""

LOADS = {
    "applied_target": "applied_target",
    "joint_torque_mean": "torque_mean",
    "joint_torque_peak": "torque_peak",
    "torque_usage": "torque_usage",
    "torque_at_limit": "torque_at_limit",
    "joint_power_mean": "power_mean",
    "joint_power_peak": "power_peak",
    "foot_contact_force_mean": "force_mean",
    "foot_contact_force_peak": "force_peak",
}
"""Arrays of a row, and where ``StepLoads`` has them."""


class RolloutRecorder:
    """Records every world of an environment, row by row.

    ``record_state`` before a step and ``record_action`` after it make one row.
    """

    def __init__(self, environment: ImitationEnvironment, writer: RowStore) -> None:
        """Allocate.

        Args:
            environment: Its worlds are recorded; it was made with ``record_loads``.
            writer: What takes the rows.
        """
        self.environment, self.writer = environment, writer
        self._allocate()
        self._views = self._state_views()
        written = {
            "joint_target": environment.motors.joint_target,
            "reward": environment.reward_terms,
            "push": environment.randomization.push,
        }
        self._action_views = {name: wp.to_torch(array) for name, array in written.items()}
        self._mean_action_view, self._mean_target_view = map(wp.to_torch, (self._mean_action, self._mean_target))
        default = environment.spec.default_joint_position
        self._default = torch.tensor(default, device=str(wp.device_to_torch(environment.device)))
        self._buffers: dict[str, torch.Tensor] = {}
        self._capacity = rows_on_device(environment.num_worlds)
        self._filled = 0

    def record_state(self, mean_action: torch.Tensor, observation: torch.Tensor | None = None) -> None:
        """Record the state before the step.

        Args:
            mean_action: Mean of the policy's actions in it, shape [num_worlds, 12].
            observation: What the policy saw of it, shape [num_worlds, size], if that is recorded, too.
        """
        environment, episodes = self.environment, self.environment.episodes
        with wp.ScopedDevice(environment.device):
            launch(record_root, dim=environment.num_worlds, inputs=[environment.robot, *self._root])
            launch(
                link_states,
                dim=(environment.num_worlds, 4, 4),
                inputs=[environment.robot, environment.simulation.geometry, *self._links],
            )
            place = [episodes.clips, episodes.placement, episodes.reference_step]
            launch(sample_reference, dim=environment.num_worlds, inputs=[*place, environment.reference])
            launch(
                record_reference,
                dim=environment.num_worlds,
                inputs=[*place, environment.reference, environment.simulation.geometry, *self._reference],
            )
            shapes = [environment.simulation.geometry, self._shapes, self._leg_distance]
            launch(least_leg_distance, dim=environment.num_worlds, inputs=[environment.robot, *shapes])
            self._mean_action_view.copy_(mean_action)
            environment.motors.compute_targets(
                self._mean_action,
                episodes.clips,
                episodes.placement,
                episodes.reference_step,
                self._mean_target,
            )
        for name, view in self._views.items():
            self._store(name, view)
        bears = self._views["foot_contact_force"].norm(dim=-1) > CONTACT_FORCE
        self._store("foot_contact", bears.float())
        self._store("action_mean", self._normalised(self._mean_target_view))
        if observation is not None:
            self._store("observation", observation)

    def present_state(self) -> dict[str, NDArray[Any]]:
        """Return the state of all worlds now, by the names of ``FINAL_STATE_ARRAYS``. It waits for the device."""
        environment = self.environment
        with wp.ScopedDevice(environment.device):
            launch(record_root, dim=environment.num_worlds, inputs=[environment.robot, *self._root])
        return {array.name: self._views[array.name].cpu().numpy().copy() for array in FINAL_STATE_ARRAYS}

    def record_action(self) -> None:
        """Record the action of the step that was just made, and its rewards; completes the row."""
        for name, view in self._action_views.items():
            self._store(name, view)
        self._store("action", self._normalised(self._action_views["joint_target"]))
        self._filled += 1
        if self._filled == self._capacity:
            self._submit()

    def finish(self) -> None:
        """Give what is left to the writer."""
        if self._filled:
            self._submit()

    def _allocate(self) -> None:
        """Allocate what the recording kernels write."""
        num_worlds = self.environment.num_worlds
        with wp.ScopedDevice(self.environment.device):
            self._root = [wp.zeros(num_worlds, dtype=kind) for kind in (wp.vec3, wp.vec4, wp.vec3, wp.vec3)]
            self._shapes = body_shapes(self.environment.spec)
            self._leg_distance = wp.zeros(num_worlds, dtype=float)
            self._mean_action, self._mean_target = (wp.zeros((num_worlds, 12), dtype=float) for _ in range(2))
            self._links = [wp.zeros((num_worlds, 16), dtype=kind) for kind in (wp.vec3, wp.vec4, wp.vec3, wp.vec3)]
            self._reference = [
                wp.zeros(num_worlds, dtype=wp.vec3),
                wp.zeros(num_worlds, dtype=wp.vec4),
                wp.zeros((num_worlds, 4), dtype=wp.vec3),
                wp.zeros(num_worlds, dtype=float),
                wp.zeros(num_worlds, dtype=int),
            ]

    def _state_views(self) -> dict[str, torch.Tensor]:
        """Return the arrays of a row that are known before the policy acts, as tensors on the device."""
        environment = self.environment
        root = ("root_position", "root_orientation", "root_linear_velocity", "root_angular_velocity")
        links = ("link_position", "link_orientation", "link_linear_velocity", "link_angular_velocity")
        reference = (
            "reference_root_position",
            "reference_root_orientation",
            "reference_foot_position",
            "phase",
            "cycle",
        )
        buffers = self._root + self._links + self._reference
        arrays: dict[str, wp.array[Any]] = dict(zip(root + links + reference, buffers, strict=True))
        arrays["reference_joint_position"] = environment.reference.joint_position
        arrays["reference_joint_velocity"] = environment.reference.joint_velocity
        arrays["reference_root_linear_velocity"] = environment.reference.linear_velocity
        arrays["reference_root_angular_velocity"] = environment.reference.angular_velocity
        arrays["joint_torque"] = environment.motors.torque
        arrays["friction_anchor"] = environment.motors.model.friction_anchor
        arrays["foot_contact_force"] = environment.simulation.foot_force
        assert environment.simulation.loads is not None
        arrays |= {name: getattr(environment.simulation.loads, load) for name, load in LOADS.items()}
        views = {name: wp.to_torch(array) for name, array in arrays.items()}
        views["leg_distance"] = wp.to_torch(self._leg_distance)
        views["reference_body_rests"] = wp.to_torch(environment.reference.body_rests)
        views["leg_contact"] = wp.to_torch(environment.simulation.leg_contact)
        views["joint_position"] = wp.to_torch(environment.robot.joint_q)[:, 7:]
        views["joint_velocity"] = wp.to_torch(environment.robot.joint_qd)[:, 6:]
        return views

    def _normalised(self, joint_target: torch.Tensor) -> torch.Tensor:
        """Return joint targets in the unit of the dataset's actions, shape [num_worlds, 12]."""
        return (joint_target - self._default) / self.environment.spec.action_scale

    def _store(self, name: str, value: torch.Tensor) -> None:
        """Copy one value into the present row of its buffer."""
        if name not in self._buffers:
            shape = (self._capacity, *value.shape)
            self._buffers[name] = torch.empty(shape, dtype=value.dtype, device=value.device)
        self._buffers[name][self._filled].copy_(value)

    def _submit(self) -> None:
        """Give the buffered rows to the writer, without waiting for the device."""
        on_gpu = self.environment.device.is_cuda
        blocks = {}
        for name, buffer in self._buffers.items():
            block = torch.empty((self._filled, *buffer.shape[1:]), dtype=buffer.dtype, pin_memory=on_gpu)
            # Later kernels on the same stream overwrite the buffer only when this copy is done.
            blocks[name] = block.copy_(buffer[: self._filled], non_blocking=True)
        ready = torch.cuda.Event() if on_gpu else None
        if ready is not None:
            ready.record()
        self.writer.submit(blocks, ready)
        self._filled = 0


def rows_on_device(num_worlds: int) -> int:
    """Return how many rows of all worlds are buffered before they are given to the writer."""
    return max(1, min(MOST_ROWS_ON_DEVICE, BYTES_ON_DEVICE // (BYTES_OF_ROW * num_worlds)))
