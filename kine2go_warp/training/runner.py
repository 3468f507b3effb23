"""RSL-RL's runner with a progress report instead of console tables, and checkpoints from which it goes on exactly."""

import contextlib
import io
import math
import statistics
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import torch
from rsl_rl.runners import OnPolicyRunner
from rsl_rl.utils.logger import Logger

from kine2go_warp.env.snapshot import EnvironmentSnapshot
from kine2go_warp.errors import Kine2GoError, PolicyError
from kine2go_warp.interruption import TrainingInterrupted
from kine2go_warp.learning.checkpoint import arrays, tensors, write_checkpoint
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.learning.presets import PpoConfig
from kine2go_warp.learning.stopping import BUDGET, TARGETS, Evaluation, TargetWatch
from kine2go_warp.learning.vec_env import BufferedVecEnv
from kine2go_warp.training.annealing import anneal
from kine2go_warp.training.divergence import DivergenceWatch
from kine2go_warp.training.tracking import TrackingEvaluator

KEPT_CHECKPOINTS = 2
"""While training: the newest, and the one before in case the newest is damaged."""


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


ProgressCallback = Callable[[TrainingProgress], None]
StopCallback = Callable[[], bool]
IterationCallback = Callable[[TrainingProgress, dict[str, float]], None]


class TargetsReached(Exception):  # noqa: N818 - no error
    """Leaves RSL-RL's loop, which knows a number of iterations only."""


@contextlib.contextmanager
def tensor_cores(device: str) -> Iterator[None]:
    """Let matrix products on a GPU round their factors to TF32, several times as fast; those on a CPU stay exact."""
    kept = torch.get_float32_matmul_precision()
    if device.startswith("cuda"):
        torch.set_float32_matmul_precision("high")
    try:
        yield
    finally:
        torch.set_float32_matmul_precision(kept)


class QuietLogger(Logger):
    """Writes to TensorBoard as RSL-RL does, and reports to a callback what RSL-RL would print."""

    steps: list[torch.Tensor]
    """Whether each world's episode has ended, its reward and length so far, of the steps since these were read."""
    first_iteration = 0
    on_iteration: IterationCallback | None = None
    count_faults: Callable[[], int] = staticmethod(lambda: 0)

    def init_logging_writer(self) -> None:
        """Append to the log. What an earlier process logged after its last checkpoint is hidden, not shown twice."""
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
        # RSL-RL divides by a difference of wall clock times, which is zero where somebody sets the clock.
        collect_time, learn_time = max(collect_time, 1e-6), max(learn_time, 1e-6)
        self.read_episodes()
        with contextlib.redirect_stdout(io.StringIO()):
            super().log(it, start_it, total_it, collect_time, learn_time, **rest)
        if self.on_iteration is not None:
            steps = self.cfg["num_steps_per_env"] * self.num_envs
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


class ImitationRunner(OnPolicyRunner):
    """Trains one policy in a folder of its own.

    A checkpoint holds, besides what RSL-RL puts there (networks with their normalisers, optimiser with its learning
    rate, iteration), under the key ``training`` all else that the next iteration depends on: every world, what it has
    seen, the phases where robots fail, the random generators, and what the watches for divergence and for the targets
    know. ``policy_state_dict`` has the weights of the best policy, where those are not the last ones. On the CPU
    training from it gives the same bits as if it had not been interrupted, with any number of processes if phases are
    not weighted by failures, and with the same number if they are.
    """

    env: BufferedVecEnv
    logger: QuietLogger

    def __init__(self, env: BufferedVecEnv, config: PpoConfig, folder: Path, seed: int) -> None:
        """Prepare; ``evaluate`` is added where a training is to stop early.

        Args:
            env: The environment that trains.
            config: Settings of the learner.
            folder: Policy folder.
            seed: Seed of the settings.
        """
        super().__init__(
            env, config.runner_settings(seed, env.config.privileged), log_dir=str(folder), device=str(env.device)
        )
        self.config, self.folder = config, PolicyFolder(folder)
        self.logger.__class__ = QuietLogger
        self.logger.steps = []
        self.logger.count_faults = lambda: self._earlier_faults + env.fault_count()
        self.logger.on_iteration = self._after_iteration
        self.watch = DivergenceWatch()
        self.evaluator: TrackingEvaluator | None = None
        self.targets: TargetWatch | None = None
        self.evaluation: Evaluation | None = None
        """Of the policy that acts in the newest checkpoint, if it was evaluated."""
        self._earlier_faults = 0
        self._saved = ""
        self._on_progress: ProgressCallback | None = None
        self._should_stop: StopCallback = lambda: False

    def train(
        self,
        iterations: int,
        on_progress: ProgressCallback | None = None,
        should_stop: StopCallback | None = None,
    ) -> str:
        """Train until the targets are met or ``iterations`` are done, counting those of a restored checkpoint.

        Returns:
            Why it stopped.

        Raises:
            TrainingDiverged: the training has broken down; see ``DivergenceWatch``.
            TrainingInterrupted: ``should_stop`` said so after an iteration; a checkpoint of it is written.
        """
        self._on_progress, self._should_stop = on_progress, should_stop or self._should_stop
        first = self.logger.first_iteration = self.current_learning_iteration
        if self.targets is not None and self.targets.is_reached:
            return TARGETS
        if iterations <= first:
            return BUDGET
        anneal(self.alg, self.config, first)
        try:
            with tensor_cores(self.device):
                self.learn(iterations - first, init_at_random_ep_len=first == 0)
        except TargetsReached:
            return TARGETS
        finally:
            self.logger.close()
        return BUDGET

    def evaluate_with(self, evaluator: TrackingEvaluator, targets: TargetWatch) -> None:
        """Evaluate the policy while it learns, and stop when the targets are met."""
        self.evaluator, self.targets = evaluator, targets

    def _evaluate(self, progress: TrainingProgress) -> TrainingProgress:
        """Evaluate the policy if it is time to, and return the progress with the last evaluation."""
        if self.evaluator is None or self.targets is None:
            return progress
        iteration, targets = progress.iteration, self.targets
        if iteration % targets.config.interval == 0 or iteration == progress.total_iterations:
            evaluation = self.evaluator.evaluate(self.alg.actor, iteration)
            targets.look(evaluation, self.alg.actor)
            self.logger.log_curves(evaluation.curves, iteration)
        return replace(progress, evaluation=targets.final or targets.latest)

    def _after_iteration(self, progress: TrainingProgress, losses: dict[str, float]) -> None:
        """Watch, evaluate, report, and stop if told to or if the targets are met."""
        models = (self.alg.actor, self.alg.critic)
        self.watch.check(progress.iteration, losses, progress.reward, progress.episode_length, models)
        progress = self._evaluate(progress)
        if self._on_progress is not None:
            self._on_progress(progress)
        anneal(self.alg, self.config, progress.iteration)
        if self.targets is not None and self.targets.is_reached:
            self.save(str(self.folder.checkpoint(self.current_learning_iteration)))
            raise TargetsReached
        if progress.iteration < progress.total_iterations and self._should_stop():
            path = self.folder.checkpoint(self.current_learning_iteration)
            self.save(str(path))
            raise TrainingInterrupted(f"stopped after iteration {progress.iteration}; {path} holds all of it")

    def save(self, path: str, infos: dict[str, Any] | None = None) -> None:
        """Write a checkpoint whole or not at all, and remove those that are no longer needed."""
        if path == self._saved:
            # RSL-RL saves the last iteration once more.
            return
        values = {**self.alg.save(), "iter": self.current_learning_iteration, "infos": infos}
        if self.targets is not None:
            values |= self.targets.policy_weights()
        write_checkpoint(Path(path), {**values, "training": self._training_state()})
        self.evaluation = self.targets.kept if self.targets is not None else None
        self.folder.keep_newest(KEPT_CHECKPOINTS)
        self._saved = path

    def restore(self, checkpoint: dict[str, Any]) -> None:
        """Continue from a checkpoint, at the iteration after the one that it was written at.

        Raises:
            PolicyError: it does not fit the settings of this training.
        """
        try:
            self.alg.load(checkpoint, None, True)
            self._restore_training_state(checkpoint["training"])
            self.current_learning_iteration = checkpoint["iter"] + 1
        except (KeyError, RuntimeError, ValueError, Kine2GoError) as error:
            reason = str(error).splitlines()[0]
            raise PolicyError(f"{self.folder.path}: its checkpoint does not fit its settings ({reason})") from None

    def _training_state(self) -> dict[str, Any]:
        """Return all that training goes on from, besides networks and optimiser."""
        snapshot = self.env.snapshot()
        random = {"cpu": torch.get_rng_state()}
        if torch.device(self.device).type == "cuda":
            random["cuda"] = torch.cuda.get_rng_state(self.device)
        return {
            **({"targets": self.targets.state()} if self.targets is not None else {}),
            "worlds": tensors(snapshot.worlds),
            "phases": tensors(snapshot.phases),
            "random": random,
            "logger": self.logger.state(),
            "watch": asdict(self.watch),
            "faults": self.logger.count_faults(),
        }

    def _restore_training_state(self, state: dict[str, Any]) -> None:
        """Put back what ``_training_state`` returned."""
        self.env.restore(EnvironmentSnapshot(arrays(state["worlds"]), arrays(state["phases"])))
        self.logger.restore(state["logger"])
        self.watch = DivergenceWatch(**state["watch"])
        if self.targets is not None and "targets" in state:
            self.targets.restore(state["targets"])
            self.evaluation = self.targets.kept
        self._earlier_faults = state["faults"]
        torch.set_rng_state(state["random"]["cpu"])
        if "cuda" in state["random"] and torch.device(self.device).type == "cuda":
            torch.cuda.set_rng_state(state["random"]["cuda"], self.device)
