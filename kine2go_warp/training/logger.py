"""RSL-RL's logger, reporting an iteration to a callback instead of the console."""

import contextlib
import io
import math
import statistics
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import torch
from rsl_rl.utils.logger import Logger

from kine2go_warp.learning.stopping import Evaluation


@dataclass(frozen=True)
class TrainingProgress:
    """What one iteration achieved."""

    iteration: int
    """Iterations done."""
    total_iterations: int
    reward: float
    """Mean reward of the last 100 episodes; NaN before the first one ends."""
    episode_length: float
    """Mean length of the last 100 episodes [control steps]; NaN before the first one ends."""
    collect_time: float
    """Time that the rollouts took [s]."""
    learn_time: float
    """Time that the update took [s]."""
    steps_per_second: float
    """Control steps of all worlds in a second, learning included."""
    faults: int
    """Episodes that the simulation itself has failed so far: buffers that were too small, numbers not finite."""
    evaluation: Evaluation | None = None
    """The last one so far, if there is one."""

    def __str__(self) -> str:
        faults = f", {self.faults} faults of the simulation" if self.faults else ""
        tracks = f"; evaluated at {self.evaluation.iteration}: {self.evaluation}" if self.evaluation else ""
        speed = f"{self.steps_per_second:,.0f} steps/s{faults}{tracks}"
        if math.isnan(self.reward):
            return f"no episode has ended yet, {speed}"
        return f"reward {self.reward:.2f}, {self.episode_length:.0f} steps an episode, {speed}"


IterationCallback = Callable[[TrainingProgress, dict[str, float]], None]


class NoLog:
    """Takes the log of a process that writes none; RSL-RL saves checkpoints only where there is one."""

    def add_scalar(self, *_: object) -> None:
        """Forget a value."""

    def close(self) -> None:
        """Do nothing."""


class QuietLogger(Logger):
    """Writes to TensorBoard as RSL-RL does, and reports to a callback what RSL-RL would print."""

    steps: list[torch.Tensor]
    """Whether each world's episode has ended, its reward and length so far, of the steps since these were read."""
    first_iteration = 0
    on_iteration: IterationCallback | None = None
    count_faults: Callable[[], int] = staticmethod(lambda: 0)

    def init_logging_writer(self) -> None:
        """Append to the log. What an earlier process logged after its last checkpoint is hidden, not shown twice."""
        if self.disable_logs:
            self.writer = NoLog()  # pyright: ignore[reportAttributeAccessIssue]
            return
        from torch.utils.tensorboard import SummaryWriter

        self.writer = SummaryWriter(log_dir=self.log_dir, purge_step=self.first_iteration, flush_secs=10)  # pyright: ignore[reportAttributeAccessIssue]

    def process_env_step(
        self,
        rewards: torch.Tensor,
        dones: torch.Tensor,
        extras: dict[str, Any],
        intrinsic_rewards: torch.Tensor | None = None,
    ) -> None:
        """Add a step to the episodes. RSL-RL reads those that end here, for which a GPU is waited for at every step."""
        del intrinsic_rewards
        if self.writer is None:
            return
        self.ep_extras.append(extras["log"])
        self.cur_reward_sum += rewards
        self.cur_episode_length += 1
        ended = dones > 0
        self.steps.append(torch.stack([ended.float(), self.cur_reward_sum, self.cur_episode_length]))
        self.cur_reward_sum = torch.where(ended, 0.0, self.cur_reward_sum)
        self.cur_episode_length = torch.where(ended, 0.0, self.cur_episode_length)

    def read_episodes(self) -> None:
        """Add the episodes that have ended since the last time to the last hundred."""
        if not self.steps:
            return
        for ended, reward, length in torch.stack(self.steps).cpu():
            self.rewbuffer.extend(reward[ended > 0].tolist())
            self.lenbuffer.extend(length[ended > 0].tolist())
        self.steps.clear()

    def log(self, it: int, start_it: int, total_it: int, collect_time: float, learn_time: float, **rest: Any) -> None:
        """Log one iteration; see ``Logger.log``."""
        # RSL-RL divides by a wall-clock difference, which is not positive after the clock was set back.
        collect_time, learn_time = max(collect_time, 1e-6), max(learn_time, 1e-6)
        self.read_episodes()
        with contextlib.redirect_stdout(io.StringIO()):
            super().log(it, start_it, total_it, collect_time, learn_time, **rest)
        if self.on_iteration is not None:
            steps = self.cfg["num_steps_per_env"] * self.num_envs * self.gpu_world_size
            progress = TrainingProgress(
                iteration=it + 1,
                total_iterations=total_it,
                reward=statistics.mean(self.rewbuffer) if self.rewbuffer else float("nan"),
                episode_length=statistics.mean(self.lenbuffer) if self.lenbuffer else float("nan"),
                collect_time=collect_time,
                learn_time=learn_time,
                steps_per_second=steps / (collect_time + learn_time),
                faults=self.count_faults(),
            )
            self.on_iteration(progress, rest["loss_dict"])

    def log_curves(self, curves: dict[str, float], iteration: int) -> None:
        """Write further curves, of the iteration after so many."""
        for name, value in curves.items():
            self.writer.add_scalar(name, value, iteration - 1)  # pyright: ignore[reportOptionalMemberAccess, reportAttributeAccessIssue]

    def state(self) -> dict[str, Any]:
        """Return what is known of episodes: it is shown, and the watch for divergence looks at it."""
        return {
            "reward_sum": self.cur_reward_sum.clone(),
            "episode_length": self.cur_episode_length.clone(),
            "last_rewards": list(self.rewbuffer),
            "last_lengths": list(self.lenbuffer),
            "time": self.tot_time,
            "steps": self.tot_timesteps,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go on where ``state`` was taken."""
        self.cur_reward_sum.copy_(state["reward_sum"])
        self.cur_episode_length.copy_(state["episode_length"])
        self.rewbuffer = deque(state["last_rewards"], maxlen=self.rewbuffer.maxlen)
        self.lenbuffer = deque(state["last_lengths"], maxlen=self.lenbuffer.maxlen)
        self.tot_time, self.tot_timesteps = state["time"], state["steps"]

    def close(self) -> None:
        """Write what is left and close the log."""
        if self.writer is not None:
            self.writer.close()  # pyright: ignore[reportAttributeAccessIssue]
            self.writer = None

    def _store_code_state(self) -> list[str]:
        """Leave the state of the user's repositories alone: the policy folder records our version itself."""
        return []
