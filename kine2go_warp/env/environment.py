"""Many worlds in which a Go2 tracks reference clips, stepped by one captured graph."""

import gc
from collections.abc import Sequence

import numpy as np
import warp as wp

from kine2go_warp.env.clips import make_reference_state
from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.episodes import Episodes, EpisodeStarts
from kine2go_warp.env.model import SpecArrays
from kine2go_warp.env.motors import NUM_JOINTS, Motors
from kine2go_warp.env.observations import observation_size
from kine2go_warp.env.randomization import Randomization
from kine2go_warp.env.simulation import OVERFLOW_MASK, Simulation
from kine2go_warp.env.terrain import build_height_field, reach_of
from kine2go_warp.kernels import observations, resets, rewards, terminations
from kine2go_warp.kernels.observations import LAST_OUTPUT, PRIVILEGED_SIZE, STATE_SIZE
from kine2go_warp.kernels.reference import sample_reference
from kine2go_warp.kernels.resets import ResetRanges
from kine2go_warp.kernels.rewards import REWARD_TERMS
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.robots import GO2, RobotSpec


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
        first_world: int = 0,
    ) -> None:
        """Build the model, reset all worlds and capture the step.

        Args:
            clips: Reference clips; each episode draws one.
            config: Settings.
            device: Warp device name, by default CUDA where there is one.
            spec: The robot.
            use_graph: Capture the step as one graph. Without it every kernel is launched from Python.
            first_world: Number of the first world: several environments may share the worlds of a larger one.
        """
        self.device = wp.get_device(device)
        self.config = config = config.on(str(self.device))
        self.spec, self.clips = spec, tuple(clips)
        with wp.ScopedDevice(self.device):
            ground = build_height_field(config.terrain, reach_of(clips, config))
            self.constants = SpecArrays.upload(spec, self.device)
            self.simulation = Simulation(spec, config, ground, self.device)
            self.motors = Motors(config, self.constants)
            self.episodes = Episodes(clips, config, ground, first_world)
            self.randomization = Randomization(config, self.simulation, self.motors, self.episodes)
            self.robot = self.simulation.robot
            self._build_buffers()
            self._graph: wp.Graph | None = None
            if use_graph:
                self._capture()
        self.restart(config.seed)

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

    def restart(self, seed: int, first_world: int | None = None, starts: EpisodeStarts | None = None) -> None:
        """Make all worlds anew from a seed, and begin an episode in each.

        Args:
            seed: Seed of all worlds.
            first_world: Number of the first one, by default that of the environment.
            starts: Where these first episodes begin; by default drawn, as for all later ones.
        """
        with wp.ScopedDevice(self.device):
            self.episodes.restart(seed, first_world)
            self.randomization.draw_bodies()
            self._begin_episodes(starts)
            self._observe()
            self.episodes.done.zero_()

    def _build_buffers(self) -> None:
        """Allocate what the policy writes and reads."""
        config, num_worlds = self.config, self.num_worlds
        self.reference = make_reference_state(num_worlds, self.device)
        self.output = wp.zeros((num_worlds, NUM_JOINTS), dtype=float)
        weights = np.array(config.reward.weights) / config.control_rate
        self.reward_weights = wp.array(weights, dtype=float)
        self.reward_terms = wp.zeros((num_worlds, len(REWARD_TERMS)), dtype=float)
        self.reward = wp.zeros(num_worlds, dtype=float)
        self.steps_ahead = wp.array(config.steps_ahead, dtype=int)
        self.observation = wp.zeros((num_worlds, observation_size(config)), dtype=float)
        privileged_size = int(PRIVILEGED_SIZE) if config.privileged else 0
        self.privileged_observation = wp.zeros((num_worlds, privileged_size), dtype=float)
        self.reset_ranges = ResetRanges()
        for name, value in vars(config.reset).items():
            setattr(self.reset_ranges, name, value)

    def _capture(self) -> None:
        """Capture the step as a graph.

        One step is run first, so that every module is loaded and every lazy allocation made.
        """
        self._begin_episodes()
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

    def _step(self) -> None:
        """Launch one control step."""
        episodes = self.episodes
        self.motors.set_targets(self.output, episodes.clips, episodes.placement, episodes.reference_step)
        self.randomization.push_robots()
        self.simulation.advance(self.motors, episodes.reference_step)
        self.simulation.collect_contacts()
        episodes.advance()
        self._evaluate()
        episodes.learn_from_failures()
        self._begin_episodes()
        self._observe()

    def _evaluate(self) -> None:
        """Compare the new state with the reference: rewards and terminations."""
        episodes, simulation, limits = self.episodes, self.simulation, self.config.termination
        wp.launch(
            sample_reference,
            dim=self.num_worlds,
            inputs=[episodes.clips, episodes.placement, episodes.reference_step, self.reference],
        )
        wp.launch(
            rewards.tracking_rewards,
            dim=self.num_worlds,
            inputs=[
                self.robot,
                self.reference,
                simulation.geometry,
                self.reward_weights,
                self.reward_terms,
                self.reward,
            ],
        )
        if self.config.reward.action_rate:
            # The observation still holds the output of the step before.
            last_output = self.observation[:, LAST_OUTPUT : LAST_OUTPUT + NUM_JOINTS]
            weight = self.config.reward.action_rate / self.config.control_rate
            inputs = [self.output, last_output, weight, self.reward]
            wp.launch(rewards.penalise_changes, dim=self.num_worlds, inputs=inputs)
        wp.launch(
            terminations.terminate,
            dim=self.num_worlds,
            inputs=[
                self.robot,
                self.reference,
                simulation.body_contact,
                simulation.overflow,
                OVERFLOW_MASK,
                episodes.length,
                self.config.max_episode_length,
                limits.max_distance,
                limits.max_angle,
                episodes.age,
                limits.looseness,
                self.config.tightening_steps,
                episodes.reason,
                episodes.reason_count,
                episodes.done,
                episodes.time_out,
            ],
        )

    def _begin_episodes(self, starts: EpisodeStarts | None = None) -> None:
        """Start a new episode in every world that is done."""
        episodes, simulation = self.episodes, self.simulation
        episodes.begin()
        if starts is not None:
            episodes.choose(starts)
        self.randomization.begin()
        drawn = [*episodes.drawn, episodes.clips, episodes.placement]
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
                self.motors.target_queue,
                self.motors.torque,
            ],
        )
        wp.launch(
            resets.reset_root,
            dim=self.num_worlds,
            inputs=[
                *drawn,
                simulation.geometry,
                self.reset_ranges,
                self.robot,
                simulation.foot_force,
                simulation.warm_start,
            ],
        )
        inputs = [episodes.done, self.output]
        wp.launch(observations.clear_outputs, dim=(self.num_worlds, NUM_JOINTS), inputs=inputs)

    def _observe(self) -> None:
        """Write the observation of the present state."""
        episodes = self.episodes
        history, shape = self.config.history_length, (self.num_worlds, int(STATE_SIZE))
        default_position = self.constants.default_position
        wp.launch(observations.shift_history, dim=shape, inputs=[self.observation, history])
        wp.launch(
            observations.observe_state,
            dim=self.num_worlds,
            inputs=[self.robot, self.output, default_position, self.observation],
        )
        wp.launch(observations.fill_history, dim=shape, inputs=[episodes.done, self.observation, history])
        wp.launch(
            observations.observe_targets,
            dim=(self.num_worlds, len(self.config.steps_ahead)),
            inputs=[
                self.robot,
                episodes.clips,
                episodes.placement,
                episodes.reference_step,
                self.steps_ahead,
                default_position,
                history * int(STATE_SIZE),
                self.observation,
            ],
        )
        if self.config.privileged:
            self._observe_privileged()

    def _observe_privileged(self) -> None:
        """Write what only the critic sees."""
        wp.launch(
            observations.observe_privileged,
            dim=self.num_worlds,
            inputs=[
                self.robot,
                self.episodes.placement,
                self.simulation.foot_force,
                self.motors.model,
                self.randomization.bodies.base,
                self.randomization.bodies.friction,
                self.config.motor.stiffness,
                self.config.motor.damping,
                self.simulation.robot_weight,
                self.privileged_observation,
            ],
        )
