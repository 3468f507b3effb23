"""Rollouts of a policy in Newton from chosen beginnings."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch
import warp as wp
from numpy.typing import NDArray

from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.episodes import EpisodeStart
from kine2go_warp.evaluation.config import EvalConfig
from kine2go_warp.learning.inference import NoisyPolicy
from kine2go_warp.learning.policy import PolicyFolder, PolicyRecord
from kine2go_warp.learning.vec_env import ImitationVecEnv
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.rollouts.campaign import read_whole
from kine2go_warp.rollouts.recorder import RolloutRecorder
from kine2go_warp.rollouts.spool import RowSpool

STEPS_BETWEEN_LOOKS = 60
"""Control steps after which it is looked whether anybody still stands, and progress is told."""

Rows = dict[str, NDArray]


@dataclass(frozen=True)
class Starts:
    """Where rollouts begin; the first axis of each is the rollout."""

    phase: NDArray
    """Place in the cycle, in [0, 1)."""
    heading: NDArray
    """Turn of the reference [rad]."""
    joint_q: NDArray
    """Coordinates as in the environment, shape [num_rollouts, 19]."""
    joint_qd: NDArray
    """Velocities as in the environment, shape [num_rollouts, 18]."""


@dataclass(frozen=True)
class Batch:
    """Rollouts of equal length, as far as they came."""

    names: tuple[str, ...]
    """Names of the arrays that there are of every row."""
    read: Callable[[str, NDArray], NDArray]
    """Returns one of them for some rollouts, NaN where they had ended, shape [num_chosen, num_rows, ...]."""
    length: NDArray
    """Rows of each rollout, shape [num_rollouts]."""
    failure: NDArray
    """Why each rollout ended early, a number of ``REASON_NAMES``, 0 if it did not."""
    starts: Starts

    def rows(self, chosen: NDArray) -> Rows:
        """Return all arrays of some rollouts."""
        return {name: self.read(name, chosen) for name in self.names}


class NewtonRollouts:
    """The worlds in which a policy is evaluated, with or without randomisation; they run one clip at a time.

    Use it as a context manager: it removes its files at the end.
    """

    def __init__(
        self,
        policy: PolicyFolder,
        record: PolicyRecord,
        clips: tuple[MotionClip, ...],
        config: EvalConfig,
        noise: tuple[float, ...],
        randomised: bool,
        device: str,
    ) -> None:
        """Build the environment and load the policy.

        Args:
            policy: The policy.
            record: Its settings.
            clips: What it tracks.
            config: Settings.
            noise: Noise on the actions in standard deviations of the policy; each has ``config.worlds`` rollouts.
            randomised: Whether the worlds differ, and robots are pushed.
            device: Where to simulate.
        """
        self.config, self.num_rows = config, config.rows(record.preset.env.control_rate)
        num_worlds = config.worlds * len(noise)
        settings = config.environment(record.preset.env, randomised, num_worlds)
        self.environment = ImitationEnvironment(clips, settings, device)
        self.env = ImitationVecEnv(self.environment)
        self.actor = NoisyPolicy(self.env, record.preset, policy.latest_checkpoint(), config.seed)
        self.noise = torch.tensor(noise).repeat_interleave(config.worlds)[:, None].to(self.env.device)
        self._folder = TemporaryDirectory(prefix="kine2go-eval-")

    def __enter__(self) -> "NewtonRollouts":
        return self

    def __exit__(self, *_: object) -> None:
        self._folder.cleanup()

    def run(self, clip: int, on_step: Callable[[int], None] | None = None) -> Batch:
        """Roll out all worlds on one clip. It overwrites the files of the clip before.

        Args:
            clip: Index of the clip.
            on_step: Called now and then with the control steps done.
        """
        starts = self._begin(clip)
        reason = wp.to_torch(self.environment.episodes.reason)
        failure, survived = torch.zeros_like(reason), torch.zeros_like(reason)
        observation = self.env.get_observations()
        with RowSpool(Path(self._folder.name) / "rows") as spool:
            recorder = RolloutRecorder(self.environment, spool)
            for step in range(self.num_rows):
                mean, output = self.actor(observation, self.noise)
                recorder.record_state()
                observation, *_ = self.env.step(output)
                recorder.record_action(mean, output)
                failure = torch.where(failure == 0, reason, failure)
                survived += (failure == 0).int()
                if (step + 1) % STEPS_BETWEEN_LOOKS == 0:
                    if on_step is not None:
                        on_step(step + 1)
                    if bool((failure > 0).all()):
                        break
            recorder.finish()
            spool.close()
        # The row in which a rollout failed is whole, but for its action, which led to no state.
        length = (survived + (failure > 0).int()).cpu().numpy()

        def read(name: str, chosen: NDArray) -> NDArray:
            values = read_whole(spool, name, chosen, self.num_rows)
            values[np.arange(self.num_rows) >= length[chosen][:, None]] = np.nan
            return values

        return Batch(spool.names, read, length, failure.cpu().numpy(), starts)

    def _begin(self, clip: int) -> Starts:
        """Begin an episode in each world, the same for every noise."""
        environment, repeats = self.environment, len(self.noise) // self.config.worlds
        phase, heading = (
            np.tile(values, repeats) for values in (self.config.start_phases(), self.config.start_headings())
        )
        starts = EpisodeStart(np.full(len(phase), clip, np.int32), phase, heading)
        environment.restart(self.config.seed, starts=starts)
        self.actor.generator.manual_seed(self.config.seed)
        robot = environment.robot
        return Starts(phase, heading, robot.joint_q.numpy().copy(), robot.joint_qd.numpy().copy())
