"""Rollouts of a policy in Newton from chosen initial states."""

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch

from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.episodes import EpisodeStart
from kine2go_warp.evaluation.config import EvalConfig
from kine2go_warp.learning.inference import NoisyPolicy
from kine2go_warp.learning.policy import PolicyFolder, PolicyRecord
from kine2go_warp.learning.vec_env import ImitationVecEnv
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.rollouts.rollout import RecordedRollouts, roll_out
from kine2go_warp.rollouts.row_writer import AsyncRowWriter


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
        self.config, self.clips = config, clips
        num_worlds = config.worlds * len(noise)
        settings = config.environment(record.preset.env, randomised, num_worlds)
        self.environment = ImitationEnvironment(clips, settings, device, record_loads=True)
        self.env = ImitationVecEnv(self.environment)
        self.actor = NoisyPolicy(self.env, record.preset, policy.latest_checkpoint(), config.seed)
        self.noise = torch.tensor(noise).repeat_interleave(config.worlds)[:, None].to(self.env.device)
        self._folder = TemporaryDirectory(prefix="kine2go-eval-")

    def __enter__(self) -> "NewtonRollouts":
        return self

    def __exit__(self, *_: object) -> None:
        self._folder.cleanup()

    def run(self, clip: int, on_progress: Callable[[int], None] | None = None) -> RecordedRollouts:
        """Roll out all worlds on one clip, from the same initial states for every noise.

        It overwrites the files of the clip before.

        Args:
            clip: Index of the clip.
            on_progress: Called now and then with the control steps done.
        """
        repeats = len(self.noise) // self.config.worlds
        phase, heading = (
            np.tile(values, repeats)
            for values in (self.config.initial_phases(self.clips[clip]), self.config.initial_headings())
        )
        starts = EpisodeStart(np.full(len(phase), clip, np.int32), phase, heading)
        self.environment.restart(self.config.seed, starts=starts)
        self.actor.generator.manual_seed(self.config.seed)
        num_rows = self.config.rows(self.environment.config.control_rate, self.clips[clip])
        with AsyncRowWriter(Path(self._folder.name) / "rows") as writer:
            return roll_out(self.env, self.actor, self.noise, num_rows, writer, on_progress=on_progress)
