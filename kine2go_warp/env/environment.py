"""Many worlds in which a robot tracks reference clips, stepped by one captured graph."""

import gc
from collections.abc import Sequence

import numpy as np
import warp as wp
from numpy.typing import NDArray

from kine2go_warp.device import fitting
from kine2go_warp.env.clips import make_reference_state, replace_clips
from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.episodes import Episodes, EpisodeStart
from kine2go_warp.env.model import SpecArrays
from kine2go_warp.env.motors import Motors
from kine2go_warp.env.observations import (
    observation_size,
    place_privileged,
    place_terms,
    privileged_size,
    state_size,
)
from kine2go_warp.env.randomization import Randomization
from kine2go_warp.env.simulation import OVERFLOW_MASK, Simulation, write_worlds
from kine2go_warp.env.terrain import build_height_field, terrain_extent
from kine2go_warp.kernels import launch, observations, resets, terminations
from kine2go_warp.kernels.reference import sample_reference
from kine2go_warp.kernels.rewards import sum_rewards
from kine2go_warp.kernels.state import NUM_JOINTS
from kine2go_warp.kernels.world import WorldView
from kine2go_warp.motions.clip import MotionClip, robot_of
from kine2go_warp.robots import RobotSpec


class ImitationEnvironment:
    """Tracks reference clips with a batch of robots (paper, section 3.2 and appendix).

    All arrays live on one device and keep their addresses: write the policy's action to ``action``, call ``step``, and
    read the results. A world whose episode ends starts a new one within the same step; its observation is the first
    of the new episode.
    """

    def __init__(
        self,
        clips: Sequence[MotionClip],
        config: EnvConfig,
        device: str | None = None,
        spec: RobotSpec | None = None,
        use_graph: bool = True,
        first_world: int = 0,
        record_loads: bool = False,
    ) -> None:
        """Build the model, reset all worlds and capture the step.

        Args:
            clips: Reference clips, all for one robot; each episode draws one.
            config: Settings.
            device: Warp device name, by default CUDA where there is one.
            spec: The robot; by default that of the clips.
            use_graph: Capture the step as one graph. Without it every kernel is launched from Python.
            first_world: Number of the first world: several environments may share the worlds of a larger one.
            record_loads: Whether ``simulation.loads`` are kept, which recording rollouts needs.

        Raises:
            Kine2GoError: the worlds do not fit into the device's memory.
        """
        self.device = wp.get_device(device)
        self.config = config = config.on(str(self.device))
        self.clips = tuple(clips)
        self.spec = spec = robot_of(self.clips) if spec is None else spec
        with wp.ScopedDevice(self.device), fitting(config.num_worlds, str(self.device)):
            ground = build_height_field(config.terrain, terrain_extent(clips, config))
            self.constants = SpecArrays.upload(spec, self.device)
            self.simulation = Simulation(spec, config, ground, self.device, record_loads)
            self.motors = Motors(config, self.constants)
            self.episodes = Episodes(clips, config, ground, first_world)
            self.randomization = Randomization(config, self.simulation, self.motors)
            self.robot = self.simulation.robot
            self._build_buffers()
            self.views = {ahead: self._build_view(ahead) for ahead in (0, *config.steps_ahead)}
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
        """Advance all worlds by one control step, with ``action`` as the policy's action."""
        with wp.ScopedDevice(self.device):
            if self._graph is not None:
                wp.capture_launch(self._graph)
            else:
                self._step()

    def restart(self, seed: int, starts: EpisodeStart | None = None) -> None:
        """Make all worlds anew from a seed, and begin an episode in each.

        Args:
            seed: Seed of all worlds.
            starts: Where these first episodes begin; by default drawn, as for all later ones.
        """
        with wp.ScopedDevice(self.device):
            self.episodes.restart(seed)
            self.motors.torque.zero_()
            self.simulation.clear_loads()
            self.randomization.draw_bodies(self.views[0])
            self._reset_worlds(starts)
            self._observe()
            self.episodes.done.zero_()

    def begin_episodes(self, worlds: NDArray[np.bool_], starts: EpisodeStart, reset_scale: NDArray[np.float32]) -> None:
        """Begin new episodes in some worlds, while the others go on as if nothing had happened.

        Args:
            worlds: Which ones, shape [num_worlds].
            starts: Where they begin.
            reset_scale: Spread of the first states, as a multiple of that of the settings, shape [num_worlds].
        """
        with wp.ScopedDevice(self.device):
            self.reset_scale.assign(reset_scale)
            self.episodes.done.assign(worlds.astype(np.int64))
            self._reset_worlds(starts)
            self._observe()
            self.episodes.done.zero_()
            position = self.robot.joint_q.numpy()[:, 7:]
            write_worlds(self.motors.model.friction_anchor, worlds, position)
            self.simulation.rest(worlds, position)

    def replace_clips(self, clips: Sequence[MotionClip]) -> None:
        """Track as many other clips, with the same numbers of frames, from the next episodes on."""
        with wp.ScopedDevice(self.device):
            replace_clips(self.episodes.clips, clips, self.config.control_duration)
        self.clips = tuple(clips)

    def _build_buffers(self) -> None:
        """Allocate what the policy writes and reads."""
        config, num_worlds = self.config, self.num_worlds
        self.reference = make_reference_state(num_worlds, self.device)
        self.reset_scale = wp.full(num_worlds, 1.0, dtype=float)
        self.action = wp.zeros((num_worlds, NUM_JOINTS), dtype=float)
        self.last_action = wp.zeros((num_worlds, NUM_JOINTS), dtype=float)
        self.rewards = config.active_rewards
        self.reward_weights = wp.array([term.weight / config.control_rate for term in self.rewards], dtype=float)
        self.reward_terms = wp.zeros((num_worlds, len(self.rewards)), dtype=float)
        self.reward = wp.zeros(num_worlds, dtype=float)
        self.observation = wp.zeros((num_worlds, observation_size(config)), dtype=float)
        self.privileged_observation = wp.zeros((num_worlds, privileged_size(config)), dtype=float)
        self.terminations = config.active_terminations
        self.conditions = wp.zeros((num_worlds, len(self.terminations)), dtype=float)
        self.is_time_out = wp.array([term.is_time_out for term in self.terminations], dtype=wp.bool)

    def _build_view(self, ahead: int) -> WorldView:  # pyright: ignore[reportGeneralTypeIssues] - a Warp struct
        """Return what terms read, which shares all arrays, for observations of a number of control steps from now."""
        config, episodes, simulation = self.config, self.episodes, self.simulation
        bodies = self.randomization.bodies
        view = WorldView()
        view.ahead = ahead
        view.robot, view.reference, view.geometry = self.robot, self.reference, simulation.geometry
        view.clips, view.placement, view.motors = episodes.clips, episodes.placement, self.motors.model
        view.base, view.friction = bodies.base, bodies.friction
        view.foot_force, view.overflow = simulation.foot_force, simulation.overflow
        view.body_contact, view.leg_contact = simulation.body_contact, simulation.leg_contact
        view.action, view.last_action = self.action, self.last_action
        view.joint_target, view.torque = self.motors.joint_target, self.motors.torque
        view.default_position = self.constants.default_position
        view.reference_step, view.episode_length = episodes.reference_step, episodes.length
        view.world_steps, view.done = episodes.world_steps, episodes.done
        view.seed, view.episode = episodes.seed, episodes.episode
        view.max_episode_length, view.overflow_mask = config.max_episode_length, OVERFLOW_MASK
        view.end_hold_steps = config.end_hold_steps
        view.initial_limit_scale = config.initial_limit_scale
        view.limit_anneal_steps = config.limit_anneal_steps
        view.nominal_stiffness, view.nominal_damping = self.motors.nominal_stiffness, self.motors.nominal_damping
        view.robot_weight, view.control_duration = simulation.robot_weight, config.control_duration
        return view

    def _capture(self) -> None:
        """Capture the step as a graph.

        One step is run first, so that every module is loaded and every lazy allocation made.
        """
        self._reset_worlds()
        self._step()
        # An old graph that is collected during a capture would corrupt the new one.
        gc.collect()
        gc.disable()
        try:
            self._graph = self.capture_step()
        finally:
            gc.enable()

    def capture_step(self, simulate: bool = True) -> wp.Graph:
        """Return a control step as a graph.

        Args:
            simulate: Whether the robots move. Without it the graph holds all kernels but the solver's and the motors',
                whose time can so be measured.
        """
        with wp.ScopedDevice(self.device), wp.ScopedCapture() as capture:
            self._step(simulate)
        assert capture.graph is not None
        return capture.graph

    def _step(self, simulate: bool = True) -> None:
        """Launch one control step."""
        episodes = self.episodes
        self.motors.set_targets(self.action, episodes.clips, episodes.placement, episodes.reference_step)
        self.randomization.push_robots(self.views[0])
        if simulate:
            self.simulation.advance(self.motors, episodes.reference_step)
        self.simulation.collect_contacts()
        episodes.advance()
        self._evaluate()
        episodes.learn_from_failures()
        self._reset_worlds()
        self._observe()

    def _evaluate(self) -> None:
        """Compare the new state with the reference: rewards and terminations."""
        episodes = self.episodes
        launch(
            sample_reference,
            dim=self.num_worlds,
            inputs=[episodes.clips, episodes.placement, episodes.reference_step, self.reference],
        )
        for column, term in enumerate(self.rewards):
            term.launch(self.views[0], self.reward_terms, column)
        inputs = [self.robot, self.reward_weights, self.reward_terms, self.reward]
        launch(sum_rewards, dim=self.num_worlds, inputs=inputs)
        for column, term in enumerate(self.terminations):
            term.launch(self.views[0], self.conditions, column)
        ends = [episodes.reason, episodes.reason_count, episodes.done, episodes.time_out]
        inputs = [self.conditions, self.is_time_out, self.simulation.overflow, *ends]
        launch(terminations.end_episodes, dim=self.num_worlds, inputs=inputs)

    def _reset_worlds(self, starts: EpisodeStart | None = None) -> None:
        """Start a new episode in every world that is done."""
        episodes, view, settings, constants = self.episodes, self.views[0], self.config.reset, self.constants
        episodes.reset()
        if starts is not None:
            episodes.set_starts(starts)
        self.randomization.reset(view)
        widths = [settings.reference_probability, settings.joint_position, settings.joint_velocity, self.reset_scale]
        inputs = [view, *widths, constants.joint_lower, constants.joint_upper, self.motors.target_queue]
        launch(resets.reset_joints, dim=self.num_worlds, inputs=inputs)
        widths = [settings.reference_probability, settings.tilt, settings.linear_velocity, settings.angular_velocity]
        inputs = [view, *widths, self.reset_scale, self.simulation.warm_start]
        launch(resets.reset_root, dim=self.num_worlds, inputs=inputs)
        launch(observations.remember_actions, dim=(self.num_worlds, int(NUM_JOINTS)), inputs=[view])

    def _observe(self) -> None:
        """Write the observation of the present state."""
        config, done = self.config, self.episodes.done
        history, size = config.history_length, state_size(config)
        shape = (self.num_worlds, size)
        launch(observations.shift_history, dim=shape, inputs=[self.observation, history, size])
        for placed in place_terms(config):
            # Older states have been moved to their places.
            if placed.offset >= 0:
                placed.term.launch(self.views[placed.offset], self.observation, placed.start)
        launch(observations.fill_history, dim=shape, inputs=[done, self.observation, history, size])
        if config.privileged:
            for placed in place_privileged(config):
                placed.term.launch(self.views[0], self.privileged_observation, placed.start)
