"""The motors of all worlds: from the policy's action to joint torques."""

from typing import Any

import numpy as np
import warp as wp

from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.model import SpecArrays
from kine2go_warp.kernels import actuation, launch
from kine2go_warp.kernels.actuation import MotorModel
from kine2go_warp.kernels.reference import Placement, ReferenceClips
from kine2go_warp.kernels.state import NUM_JOINTS
from kine2go_warp.robots.spec import FRICTION_DAMPING, FRICTION_STIFFNESS


class Motors:
    """Joint targets, their latency, and the torques that follow from them."""

    def __init__(self, config: EnvConfig, constants: SpecArrays) -> None:
        self.config, self.constants = config, constants
        shape = (config.num_worlds, NUM_JOINTS)
        self.joint_target = wp.zeros(shape, dtype=float)
        self.torque = wp.zeros(shape, dtype=float)
        queue_length = config.delay_range[1] // config.substeps + 2
        self.target_queue = wp.zeros((config.num_worlds, queue_length, NUM_JOINTS), dtype=float)
        self.model = MotorModel()
        self.nominal_stiffness, self.nominal_damping = config.motor.gains(constants.spec)
        self.model.stiffness = wp.full(shape, self.nominal_stiffness, dtype=float)
        self.model.damping = wp.full(shape, self.nominal_damping, dtype=float)
        self.model.strength = wp.full(shape, 1.0, dtype=float)
        self.model.offset = wp.zeros(shape, dtype=float)
        self.model.delay = wp.full(config.num_worlds, config.delay_substeps, dtype=int)
        for name, values in vars(config.motor.limits(constants.spec)).items():
            setattr(self.model, name, wp.array(values, dtype=float))
        self.nominal_friction = wp.array(config.motor.joint_friction(constants.spec), dtype=float)
        self.model.friction = wp.array(np.tile(self.nominal_friction.numpy(), (config.num_worlds, 1)), dtype=float)
        self.model.friction_anchor = wp.zeros(shape, dtype=float)
        self.model.friction_stiffness, self.model.friction_damping = FRICTION_STIFFNESS, FRICTION_DAMPING

    def set_targets(
        self,
        action: wp.array[Any],
        clips: ReferenceClips,  # pyright: ignore[reportGeneralTypeIssues] - a Warp struct
        placement: Placement,  # pyright: ignore[reportGeneralTypeIssues] - a Warp struct
        reference_step: wp.array[Any],
    ) -> None:
        """Turn the policy's action into joint targets and queue them."""
        self.compute_targets(action, clips, placement, reference_step, self.joint_target)
        self.queue_targets(self.joint_target, reference_step)

    def compute_targets(
        self,
        action: wp.array[Any],
        clips: ReferenceClips,  # pyright: ignore[reportGeneralTypeIssues] - a Warp struct
        placement: Placement,  # pyright: ignore[reportGeneralTypeIssues] - a Warp struct
        reference_step: wp.array[Any],
        joint_target: wp.array[Any],
    ) -> None:
        """Write the joint targets [rad] that follow from the policy's action, both of shape [num_worlds, 12]."""
        settings, shape = self.config.action, self.joint_target.shape
        if settings.mode == "default_offset":
            inputs = [action, self.constants.default_position, settings.scale, settings.clip, joint_target]
            launch(actuation.targets_from_default_pose, dim=shape, inputs=inputs)
        elif settings.mode in ("residual_ff", "residual"):
            lead = self.nominal_damping / self.nominal_stiffness
            inputs = [
                action,
                clips,
                placement,
                reference_step,
                1.0 + self.config.delay_substeps / self.config.substeps,
                lead if settings.mode == "residual_ff" else 0.0,
                settings.scale,
                settings.clip,
                joint_target,
            ]
            launch(actuation.targets_from_reference, dim=shape, inputs=inputs)
        else:
            wp.copy(joint_target, action)

    def queue_targets(self, joint_target: wp.array[Any], reference_step: wp.array[Any]) -> None:
        """Queue joint targets [rad], shape [num_worlds, 12]."""
        inputs = [joint_target, reference_step, self.target_queue]
        launch(actuation.push_target, dim=joint_target.shape, inputs=inputs)

    def apply(
        self,
        substep: int,
        reference_step: wp.array[Any],
        joint_q: wp.array[Any],
        joint_qd: wp.array[Any],
        joint_force: wp.array[Any],
    ) -> None:
        """Write the torques of a physics substep."""
        launch(
            actuation.apply_motor_torque,
            dim=self.torque.shape,
            inputs=[
                joint_q,
                joint_qd,
                self.target_queue,
                reference_step,
                substep,
                self.config.substeps,
                self.model,
                joint_force,
                self.torque,
            ],
        )
