"""RSL-RL's runner with a progress report instead of console tables, and checkpoints that are whole and unpickled."""

import contextlib
import io
import statistics
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from rsl_rl.runners import OnPolicyRunner
from rsl_rl.utils.logger import Logger

from kine2go_warp.errors import PolicyError
from kine2go_warp.files import atomic_file
from kine2go_warp.learning.presets import PpoConfig
from kine2go_warp.learning.vec_env import BufferedVecEnv


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

    def __str__(self) -> str:
        episode = f"{self.episode_length:.0f} steps an episode"
        faults = f", {self.faults} faults of the simulation" if self.faults else ""
        return f"reward {self.reward:.2f}, {episode}, {self.steps_per_second:,.0f} steps/s{faults}"


ProgressCallback = Callable[[TrainingProgress], None]


class QuietLogger(Logger):
    """Writes to TensorBoard as RSL-RL does, and reports to a callback what RSL-RL would print."""

    on_progress: ProgressCallback | None = None
    count_faults: Callable[[], int] = staticmethod(lambda: 0)

    def log(self, it: int, start_it: int, total_it: int, collect_time: float, learn_time: float, **rest: Any) -> None:
        """Log one iteration; see ``Logger.log``."""
        with contextlib.redirect_stdout(io.StringIO()):
            super().log(it, start_it, total_it, collect_time, learn_time, **rest)
        if self.on_progress is not None:
            steps = self.cfg["num_steps_per_env"] * self.num_envs
            self.on_progress(
                TrainingProgress(
                    iteration=it + 1,
                    total_iterations=total_it,
                    reward=statistics.mean(self.rewbuffer) if self.rewbuffer else float("nan"),
                    episode_length=statistics.mean(self.lenbuffer) if self.lenbuffer else float("nan"),
                    collect_time=collect_time,
                    learn_time=learn_time,
                    steps_per_second=steps / (collect_time + learn_time),
                    faults=self.count_faults(),
                )
            )

    def _store_code_state(self) -> list[str]:
        """Leave the state of the user's repositories alone: the policy folder records our version itself."""
        return []


class ImitationRunner(OnPolicyRunner):
    """Trains one policy in a folder of its own."""

    def __init__(self, env: BufferedVecEnv, config: PpoConfig, folder: Path, seed: int) -> None:
        super().__init__(
            env, config.runner_settings(seed, env.config.privileged), log_dir=str(folder), device=str(env.device)
        )
        self.logger.__class__ = QuietLogger
        assert isinstance(self.logger, QuietLogger)
        self.logger.count_faults = env.fault_count

    def train(self, iterations: int, on_progress: ProgressCallback | None = None) -> None:
        """Train until ``iterations`` are done in total, counting those of a restored checkpoint."""
        assert isinstance(self.logger, QuietLogger)
        self.logger.on_progress = on_progress
        remaining = iterations - self.current_learning_iteration
        if remaining > 0:
            self.learn(remaining, init_at_random_ep_len=True)

    def save(self, path: str, infos: dict | None = None) -> None:
        """Write a checkpoint whole or not at all."""
        buffer = io.BytesIO()
        torch.save({**self.alg.save(), "iter": self.current_learning_iteration, "infos": infos}, buffer)
        # Through memory, since torch reports a full disk as an internal error.
        with atomic_file(Path(path)) as temporary:
            temporary.write_bytes(buffer.getbuffer())

    def restore(self, path: Path) -> None:
        """Continue from a checkpoint, at the iteration after the one that it was written at."""
        checkpoint = load_checkpoint(path, self.device)
        self.alg.load(checkpoint, None, True)
        self.current_learning_iteration = checkpoint["iter"] + 1


def load_checkpoint(path: Path, device: str) -> dict[str, Any]:
    """Read a checkpoint without running any code in it.

    Raises:
        PolicyError: it is damaged or of another kind.
    """
    try:
        checkpoint = torch.load(path, map_location=device, weights_only=True)
    except Exception as error:  # noqa: BLE001 - damaged files raise errors of many kinds
        raise PolicyError(f"{path}: not a checkpoint that can be read ({error.__class__.__name__})") from None
    if not isinstance(checkpoint, dict) or "actor_state_dict" not in checkpoint:
        raise PolicyError(f"{path}: not a checkpoint of 'kine2go train'")
    return checkpoint
