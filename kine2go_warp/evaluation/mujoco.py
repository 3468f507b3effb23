"""Rollouts of an exported policy in plain MuJoCo, the C engine: nothing of Newton's runs, and none of the kernels."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from kine2go_warp.deployment.controller import ExportedPolicy, PolicyController
from kine2go_warp.deployment.observer import MeasuredState
from kine2go_warp.deployment.rotations import to_matrix
from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.mujoco_engine import FIRST_DOF, MotorState, MujocoRobot
from kine2go_warp.errors import PolicyError
from kine2go_warp.evaluation.config import EvalConfig
from kine2go_warp.motions.clip import robot_of
from kine2go_warp.robots import MotorLimits
from kine2go_warp.robots.kinematics import link_positions
from kine2go_warp.rollouts.rollout import InitialStates, RecordedRollouts, Rows


@dataclass
class Track:
    """What has been seen of one rollout, row by row."""

    rows: dict[str, list[NDArray[Any]]]
    failure: str = ""

    def add(self, **values: Any) -> None:
        """Add a row."""
        for name, value in values.items():
            self.rows.setdefault(name, []).append(np.array(value))


KNOWN_ENDS = ("non_finite", "overflow", "body_contact", "distance", "rotation", "time_out")
"""Terminations that are computed here; MuJoCo's buffers grow, so that they never overflow."""


class MujocoRollouts:
    """Lets an exported policy drive one robot after the other in plain MuJoCo."""

    def __init__(self, policy: ExportedPolicy, trained: EnvConfig, config: EvalConfig) -> None:
        """Compile the model from URDF and specification.

        Args:
            policy: The policy; gains, torque limits, joint friction, rates and latency are those of its metadata.
            trained: Settings of the training, for ground friction and the options of the solver.
            config: Settings of the evaluation.

        Raises:
            PolicyError: the policy was trained on ground that is not flat.
        """
        if not trained.terrain.is_flat:
            raise PolicyError(
                f"plain MuJoCo has flat ground only, and this policy was trained on {trained.terrain.kind}"
            )
        metadata = policy.metadata
        self.policy, self.config, self.spec = policy, config, robot_of(policy.clips)
        self.unknown_ends = tuple(one.name for one in trained.active_terminations if one.name not in KNOWN_ENDS)
        """Terminations of the training that end no rollout here, as they are Warp kernels."""
        motors = MotorState(
            stiffness=np.full(12, metadata.stiffness),
            damping=np.full(12, metadata.damping),
            strength=np.ones(12),
            offset=np.zeros(12),
            delay=metadata.latency_substeps,
            limits=metadata.motor_limits or MotorLimits.constant(metadata.torque_limit),
            friction=np.array(metadata.joint_friction or (0.0,) * 12),
        )
        self.robot = MujocoRobot(trained, self.spec, motors)

    def run(
        self, clip: int, initial: InitialStates, on_rollout: Callable[[int], None] | None = None
    ) -> RecordedRollouts:
        """Roll out from the given initial states, one after the other.

        Args:
            clip: Index of the clip.
            initial: Where the rollouts begin.
            on_rollout: Called with the number of those that are done.
        """
        controller, tracks = PolicyController(self.policy, clip), []
        num_rows = self.config.rows(self.policy.metadata.control_rate, self.policy.clips[clip])
        for index in range(len(initial.phase)):
            self.robot.set_state(initial.joint_q[index], initial.joint_qd[index])
            controller.begin(float(initial.phase[index]), (0.0, 0.0), float(initial.heading[index]))
            tracks.append(self._roll_out(controller, num_rows))
            if on_rollout is not None:
                on_rollout(index + 1)
        length = np.array([len(track.rows["phase"]) for track in tracks])
        completed = [self._completed(track, num_rows) for track in tracks]

        def read(name: str, chosen: NDArray[Any]) -> NDArray[Any]:
            return np.stack([completed[index][name] for index in chosen])

        failure = np.array([track.failure for track in tracks])
        return RecordedRollouts(tuple(completed[0]), read, length, failure, initial)

    def measured(self) -> MeasuredState:
        """Return what the robot measures now."""
        data = self.robot.data
        orientation = data.qpos[3:7].copy()
        return MeasuredState(
            root_position=data.qpos[:3].copy(),
            root_orientation=orientation,
            # MuJoCo gives the velocity of the base link origin in the world, and the turn rate in the base frame.
            root_linear_velocity=data.qvel[:3].copy(),
            root_angular_velocity=to_matrix(orientation) @ data.qvel[3:6],
            joint_position=data.qpos[7:].copy(),
            joint_velocity=data.qvel[FIRST_DOF:].copy(),
        )

    def _roll_out(self, controller: PolicyController, num_rows: int) -> Track:
        """Run one rollout to its end."""
        track, state = Track({}), self.measured()
        for step in range(num_rows):
            root = controller.reference.root(step)
            target = controller.act(state)
            track.add(
                root_position=state.root_position,
                root_orientation=state.root_orientation,
                joint_position=state.joint_position,
                joint_velocity=state.joint_velocity,
                torque_at_limit=self.robot.torque_at_limit,
                joint_power_mean=self.robot.joint_power,
                joint_target=target,
                reference_root_position=root.position,
                reference_root_rotation=root.rotation,
                reference_joint_position=controller.reference.joint_position(step),
                phase=controller.reference.phase(step),
            )
            self.robot.step(target)
            state = self.measured()
            track.failure = self._failure(state, controller, step + 1)
            if track.failure:
                break
        return track

    def _failure(self, state: MeasuredState, controller: PolicyController, step: int) -> str:
        """Return why a rollout must end, no text if it goes on, by the package's own terms."""
        data, root = self.robot.data, controller.reference.root(step)
        if not (np.isfinite(data.qpos).all() and np.isfinite(data.qvel).all()):
            return "non_finite"
        if self.robot.touches_ground and not controller.reference.body_may_touch(step):
            return "body_contact"
        if np.linalg.norm(state.root_position - root.position) > self.config.max_distance:
            return "distance"
        if turn_between(state.root_orientation, root.rotation) > self.config.max_angle:
            return "rotation"
        return ""

    def _completed(self, track: Track, num_rows: int) -> Rows:
        """Return the rows of a rollout as in a dataset, NaN after its end."""
        rows = {name: np.array(values) for name, values in track.rows.items()}
        reference = Rotation.from_matrix(rows.pop("reference_root_rotation"))
        rows["reference_root_orientation"] = reference.as_quat(scalar_first=True)
        orientation = Rotation.from_quat(rows["root_orientation"], scalar_first=True)
        rows["link_position"] = self._links(rows["root_position"], orientation, rows["joint_position"])
        links = self._links(rows["reference_root_position"], reference, rows["reference_joint_position"])
        rows["reference_foot_position"] = links[:, -4:]
        rows["action"] = (rows["joint_target"] - self.spec.default_joint_position) / self.spec.action_scale
        missing = num_rows - len(rows["phase"])
        return {
            name: np.concatenate([values, np.full((missing, *values.shape[1:]), np.nan)])
            for name, values in rows.items()
        }

    def _links(self, position: NDArray[Any], orientation: Rotation, joints: NDArray[Any]) -> NDArray[Any]:
        """Return joint centres and feet in the world [m], shape [num_rows, 16, 3]."""
        in_base = link_positions(self.spec, joints)
        return np.einsum("tij,tkj->tki", orientation.as_matrix(), in_base) + position[:, None]


def turn_between(wxyz: NDArray[Any], rotation: NDArray[Any]) -> float:
    """Return the angle between two orientations [rad]."""
    # The trace of a rotation is 1 + 2 cos(angle); limits are far from where this loses digits.
    return float(np.arccos(np.clip(0.5 * (np.sum(to_matrix(wxyz) * rotation) - 1.0), -1.0, 1.0)))
