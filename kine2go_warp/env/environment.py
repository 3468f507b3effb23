"""Many worlds in which a Go2 tracks reference clips, stepped by one captured graph."""

import gc
from collections.abc import Sequence

import numpy as np
import warp as wp

from kine2go_warp.env.clips import make_placement, make_reference_state, upload_clips
from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.model import (
    SpecArrays,
    base_com,
    build_model,
    build_solver,
    by_world,
    geom_roles,
    leg_geometry,
    silence_iteration_warnings,
)
from kine2go_warp.env.observations import observation_size
from kine2go_warp.kernels import actuation, contacts, observations, resets, rewards, terminations
from kine2go_warp.kernels.observations import STATE_SIZE
from kine2go_warp.kernels.reference import sample_reference
from kine2go_warp.kernels.resets import ResetRanges
from kine2go_warp.kernels.rewards import REWARD_TERMS
from kine2go_warp.kernels.state import RobotState
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.robots import GO2, RobotSpec

NUM_JOINTS = 12


class ImitationEnvironment:
    """Tracks reference clips with a batch of robots (paper, section 3.2 and appendix).

    All arrays live on one device and keep their addresses: write the policy's output to ``output``, call ``step``, and
    read the results. A world whose episode ends starts a new one within the same step; its observation is the first
    of the new episode.
    """

    def __init__(
        self,
        clips: Sequence[MotionClip],
        config: EnvConfig,
        device: str | None = None,
        spec: RobotSpec = GO2,
        use_graph: bool = True,
    ) -> None:
        """Build the model, reset all worlds and capture the step.

        Args:
            clips: Reference clips; each episode draws one.
            config: Settings.
            device: Warp device name, by default CUDA where there is one.
            spec: The robot.
            use_graph: Capture the step as one graph. Without it every kernel is launched from Python.
        """
        self.config, self.spec, self.clips = config, spec, tuple(clips)
        self.device = wp.get_device(device)
        with wp.ScopedDevice(self.device):
            self._build_simulation()
            self._build_buffers()
            self._graph: wp.Graph | None = None
            self.done.fill_(1)
            self._begin_episodes()
            self._observe()
            if use_graph:
                self._capture()

    @property
    def num_worlds(self) -> int:
        """Number of worlds."""
        return self.config.num_worlds

    @property
    def num_joints(self) -> int:
        """Number of actuated joints, the size of an action."""
        return NUM_JOINTS

    def step(self) -> None:
        """Advance all worlds by one control step, with ``output`` as the policy's output."""
        with wp.ScopedDevice(self.device):
            if self._graph is not None:
                wp.capture_launch(self._graph)
            else:
                self._step()

    def restart(self, seed: int) -> None:
        """Begin a new episode in every world, drawn from a new seed."""
        with wp.ScopedDevice(self.device):
            self.seed.assign(world_seeds(seed, self.num_worlds))
            self.episode.zero_()
            self.control_step.zero_()
            self.done.fill_(1)
            self._begin_episodes()
            self._observe()
            self.done.zero_()

    def _build_simulation(self) -> None:
        """Build Newton's model and solver, and view its coordinates by world."""
        config, num_worlds = self.config, self.num_worlds
        self.model = build_model(self.spec, config, self.device)
        self.solver = build_solver(self.model, config.solver)
        silence_iteration_warnings(self.solver)
        self.states = (self.model.state(), self.model.state())
        self.control = self.model.control()
        self.joint_force = by_world(self.control.joint_f, num_worlds)
        self.coordinates = [
            (by_world(state.joint_q, num_worlds), by_world(state.joint_qd, num_worlds)) for state in self.states
        ]
        self.robot = RobotState()
        self.robot.joint_q, self.robot.joint_qd = self.coordinates[0]
        self.robot.com_b = wp.array(base_com(self.model, num_worlds), dtype=wp.vec3)
        self.geometry = leg_geometry(self.spec, self.device)
        self.constants = SpecArrays.upload(self.spec, self.device)
        self.geom_role = wp.array(geom_roles(self.model, self.solver, self.spec), dtype=int)

    def _build_buffers(self) -> None:
        """Allocate everything that the step reads and writes."""
        config, num_worlds = self.config, self.num_worlds
        self.reference_clips = upload_clips(self.clips, config.control_duration, self.device)
        self.placement = make_placement(num_worlds, self.device)
        self.reference = make_reference_state(num_worlds, self.device)

        self.seed = wp.array(world_seeds(config.seed, num_worlds), dtype=wp.uint32)
        self.episode = wp.zeros(num_worlds, dtype=int)
        self.control_step = wp.zeros(1, dtype=int)
        self.reference_step = wp.zeros(num_worlds, dtype=int)
        self.episode_length = wp.zeros(num_worlds, dtype=wp.int64)

        self.output = wp.zeros((num_worlds, NUM_JOINTS), dtype=float)
        self.joint_target = wp.zeros((num_worlds, NUM_JOINTS), dtype=float)
        self.torque = wp.zeros((num_worlds, NUM_JOINTS), dtype=float)
        queue_length = config.delay_substeps // config.substeps + 2
        self.target_queue = wp.zeros((num_worlds, queue_length, NUM_JOINTS), dtype=float)
        self.delay = wp.full(num_worlds, config.delay_substeps, dtype=int)
        self.stiffness = wp.full((num_worlds, NUM_JOINTS), config.motor.stiffness, dtype=float)
        self.damping = wp.full((num_worlds, NUM_JOINTS), config.motor.damping, dtype=float)

        self.foot_force = wp.zeros((num_worlds, 4), dtype=wp.vec3)
        self.body_contact = wp.zeros(num_worlds, dtype=int)
        self.leg_contact = wp.zeros(num_worlds, dtype=int)

        weights = np.array(config.reward.weights) / config.control_rate
        self.reward_weights = wp.array(weights, dtype=float)
        self.reward_terms = wp.zeros((num_worlds, len(REWARD_TERMS)), dtype=float)
        self.reward = wp.zeros(num_worlds, dtype=float)
        self.reason = wp.zeros(num_worlds, dtype=int)
        self.done = wp.zeros(num_worlds, dtype=wp.int64)
        self.time_out = wp.zeros(num_worlds, dtype=wp.bool)

        self.steps_ahead = wp.array(config.steps_ahead, dtype=int)
        self.observation = wp.zeros((num_worlds, observation_size(config)), dtype=float)
        self.reset_ranges = ResetRanges()
        for name, value in vars(config.reset).items():
            setattr(self.reset_ranges, name, value)

    def _capture(self) -> None:
        """Capture the step as a graph.

        One step is run first, so that every module is loaded and every lazy allocation made; then the worlds start
        afresh.
        """
        self._step()
        # An old graph that is collected during a capture would corrupt the new one.
        gc.collect()
        gc.disable()
        try:
            with wp.ScopedCapture() as capture:
                self._step()
        finally:
            gc.enable()
        self._graph = capture.graph
        self.restart(self.config.seed)

    def _step(self) -> None:
        """Launch one control step."""
        self._set_targets()
        self._simulate()
        self._collect_contacts()
        wp.launch(
            resets.advance_counters,
            dim=self.num_worlds,
            inputs=[self.control_step, self.reference_step, self.episode_length],
        )
        self._evaluate()
        self._begin_episodes()
        self._observe()

    def _set_targets(self) -> None:
        """Turn the policy's output into joint targets and queue them."""
        action, shape = self.config.action, (self.num_worlds, NUM_JOINTS)
        if action.form == "default_pose":
            inputs = [self.output, self.constants.default_position, action.scale, action.clip, self.joint_target]
            wp.launch(actuation.targets_from_default_pose, dim=shape, inputs=inputs)
        else:
            inputs = [
                self.output,
                self.reference_clips,
                self.placement,
                self.reference_step,
                1.0 + self.config.delay_substeps / self.config.substeps,
                self.config.motor.damping / self.config.motor.stiffness,
                action.scale,
                action.clip,
                self.joint_target,
            ]
            wp.launch(actuation.targets_from_reference, dim=shape, inputs=inputs)
        inputs = [self.joint_target, self.control_step, self.target_queue]
        wp.launch(actuation.push_target, dim=shape, inputs=inputs)

    def _simulate(self) -> None:
        """Run the physics substeps; an even number of them ends in the state that they began with."""
        for substep in range(self.config.substeps):
            now, after = substep % 2, 1 - substep % 2
            wp.launch(
                actuation.apply_motor_torque,
                dim=(self.num_worlds, NUM_JOINTS),
                inputs=[
                    *self.coordinates[now],
                    self.target_queue,
                    self.control_step,
                    substep,
                    self.config.substeps,
                    self.delay,
                    self.stiffness,
                    self.damping,
                    self.constants.effort,
                    self.joint_force,
                    self.torque,
                ],
            )
            self.solver.step(self.states[now], self.states[after], self.control, None, self.config.substep_duration)

    def _collect_contacts(self) -> None:
        """Read foot forces and falls of the last substep."""
        data = self.solver.mjw_data
        results = [self.foot_force, self.body_contact, self.leg_contact]
        wp.launch(contacts.clear_contacts, dim=self.num_worlds, inputs=results)
        wp.launch(
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

    def _evaluate(self) -> None:
        """Compare the new state with the reference: rewards and terminations."""
        wp.launch(
            sample_reference,
            dim=self.num_worlds,
            inputs=[self.reference_clips, self.placement, self.reference_step, self.reference],
        )
        wp.launch(
            rewards.tracking_rewards,
            dim=self.num_worlds,
            inputs=[
                self.robot,
                self.reference,
                self.geometry,
                self.reward_weights,
                self.reward_terms,
                self.reward,
            ],
        )
        wp.launch(
            terminations.terminate,
            dim=self.num_worlds,
            inputs=[
                self.robot,
                self.reference,
                self.body_contact,
                self.episode_length,
                self.config.max_episode_length,
                self.config.termination.max_distance,
                self.config.termination.max_angle,
                self.reason,
                self.done,
                self.time_out,
            ],
        )

    def _begin_episodes(self) -> None:
        """Start a new episode in every world that is done."""
        wp.launch(
            resets.draw_episodes,
            dim=self.num_worlds,
            inputs=[
                self.done,
                self.seed,
                self.episode,
                self.reference_clips,
                self.placement,
                self.reference_step,
                self.episode_length,
            ],
        )
        drawn = [self.done, self.seed, self.episode, self.reference_clips, self.placement]
        wp.launch(
            resets.reset_joints,
            dim=self.num_worlds,
            inputs=[
                *drawn,
                self.reset_ranges,
                self.constants.default_position,
                self.constants.joint_lower,
                self.constants.joint_upper,
                self.robot,
                self.target_queue,
                self.torque,
            ],
        )
        warm_start = self.solver.mjw_data.qacc_warmstart
        wp.launch(
            resets.reset_root,
            dim=self.num_worlds,
            inputs=[*drawn, self.geometry, self.reset_ranges, self.robot, self.foot_force, warm_start],
        )
        inputs = [self.done, self.output]
        wp.launch(observations.clear_outputs, dim=(self.num_worlds, NUM_JOINTS), inputs=inputs)

    def _observe(self) -> None:
        """Write the observation of the present state."""
        history, shape = self.config.history_length, (self.num_worlds, int(STATE_SIZE))
        default_position = self.constants.default_position
        wp.launch(observations.shift_history, dim=shape, inputs=[self.observation, history])
        wp.launch(
            observations.observe_state,
            dim=self.num_worlds,
            inputs=[self.robot, self.output, default_position, self.observation],
        )
        wp.launch(observations.fill_history, dim=shape, inputs=[self.done, self.observation, history])
        wp.launch(
            observations.observe_targets,
            dim=(self.num_worlds, len(self.config.steps_ahead)),
            inputs=[
                self.robot,
                self.reference_clips,
                self.placement,
                self.reference_step,
                self.steps_ahead,
                default_position,
                history * int(STATE_SIZE),
                self.observation,
            ],
        )


def world_seeds(seed: int, num_worlds: int) -> np.ndarray:
    """Return one independent seed a world, shape [num_worlds]."""
    return np.random.SeedSequence(seed).generate_state(num_worlds, dtype=np.uint32)
