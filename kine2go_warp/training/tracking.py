"""Evaluates a policy while it learns: its mean action in worlds set aside, judged by the filter of gathering."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from rsl_rl.models import MLPModel
from tensordict import TensorDict

from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.episodes import EpisodeStart
from kine2go_warp.env.terms.randomization import RANDOMIZATION
from kine2go_warp.learning.stopping import ERRORS, ClipEvaluation, Evaluation, StoppingConfig, TrackingMetrics
from kine2go_warp.learning.vec_env import ImitationVecEnv
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.rollouts.config import GatherConfig, rollout_environment
from kine2go_warp.rollouts.quality import filter_rollouts
from kine2go_warp.rollouts.rollout import roll_out
from kine2go_warp.rollouts.row_writer import RowMemory

FIRST_FRAME_SHARE = 0.25
"""Share of the rollouts that begin at the first frame of their clip."""


class TrackingEvaluator:
    """Worlds of its own, without randomisation or noise, that begin alike each time.

    An evaluation depends on the weights alone: it draws no random number and touches no world that trains.
    """

    def __init__(self, clips: Sequence[MotionClip], trained: EnvConfig, config: StoppingConfig, device: str) -> None:
        """Build the worlds.

        Args:
            clips: What the policy tracks.
            trained: The environment that it learns in.
            config: How many rollouts, and how long.
            device: Where to simulate.
        """
        self.limits, self.names = GatherConfig(), [clip.name for clip in clips]
        each = max(2, config.rollouts // len(clips))
        self.num_first = max(1, round(FIRST_FRAME_SHARE * each))
        spread = each - self.num_first
        phase = np.concatenate([np.zeros(self.num_first), (np.arange(spread) + 0.5) / spread])
        self.starts = EpisodeStart(
            np.repeat(np.arange(len(clips)), each).astype(np.int32),
            np.tile(phase, len(clips)).astype(np.float32),
            np.linspace(-np.pi, np.pi, each * len(clips), endpoint=False).astype(np.float32),
        )
        limits = (self.limits.max_distance, self.limits.max_angle)
        self.seed, self.num_rows = trained.seed, round(config.seconds * trained.control_rate)
        settings = rollout_environment(
            trained, each * len(clips), trained.seed, config.seconds + 1.0, limits, RANDOMIZATION
        )
        self.env = ImitationVecEnv(ImitationEnvironment(clips, settings, device, record_loads=True))

    @torch.inference_mode()
    def evaluate(self, actor: MLPModel, iteration: int) -> Evaluation:
        """Roll the mean action out.

        Args:
            actor: The policy.
            iteration: Iterations that it has learned for.
        """
        environment = self.env.environment
        environment.restart(self.seed, self.starts)

        def act(observation: TensorDict, noise: torch.Tensor | float) -> tuple[torch.Tensor, torch.Tensor]:
            del noise
            mean = actor(observation)
            return mean, mean

        recorded = roll_out(self.env, act, 0.0, self.num_rows, RowMemory())
        worlds = np.arange(self.env.num_envs)
        duration, spec = environment.config.control_duration, environment.spec
        result = filter_rollouts(recorded.rows(worlds), recorded.failure, self.limits, duration, spec)

        def measured(worlds: NDArray[np.int_]) -> TrackingMetrics:
            shares = (np.mean(recorded.failure[worlds] == ""), np.mean(result.accepted[worlds]))
            errors = (np.mean(result.quality[name][worlds]) for name in ERRORS)
            return TrackingMetrics(*map(float, (*shares, *errors)))

        by_clip = zip(self.names, worlds.reshape(len(self.names), -1), strict=True)
        first = self.num_first
        counts = Counter(reason for reason in result.reasons if reason)
        return Evaluation(
            iteration,
            {name: ClipEvaluation(measured(some[first:]), measured(some[:first])) for name, some in by_clip},
            rejected=", ".join(f"{count} {reason}" for reason, count in sorted(counts.items())),
        )
