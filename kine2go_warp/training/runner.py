"""RSL-RL's runner with a progress report instead of console tables, and checkpoints from which it goes on exactly."""

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import torch
from rsl_rl.runners import OnPolicyRunner

from kine2go_warp.env.snapshot import EnvironmentSnapshot
from kine2go_warp.errors import Kine2GoError, PolicyError
from kine2go_warp.interruption import TrainingInterrupted
from kine2go_warp.learning.checkpoint import (
    OTHER_RANKS,
    acting_weights,
    arrays,
    load_checkpoint,
    tensors,
    write_checkpoint,
)
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.learning.presets import PpoConfig
from kine2go_warp.learning.stopping import BUDGET, TARGETS, Evaluation, TargetWatch
from kine2go_warp.learning.vec_env import BufferedVecEnv
from kine2go_warp.training.annealing import anneal
from kine2go_warp.training.divergence import DivergenceWatch
from kine2go_warp.training.logger import QuietLogger, TrainingProgress
from kine2go_warp.training.ranks import ALONE, Ranks
from kine2go_warp.training.tracking import TrackingEvaluator

KEPT_CHECKPOINTS = 2
"""While training: the newest, and the one before in case the newest is damaged."""


ProgressCallback = Callable[[TrainingProgress], None]
StopCallback = Callable[[], bool]


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


class ImitationRunner(OnPolicyRunner):
    """Trains one policy in a folder of its own.

    A checkpoint holds, besides what RSL-RL puts there (networks with their normalisers, optimiser with its learning
    rate, iteration), under the key ``training`` all else that the next iteration depends on: every world, what it has
    seen, the phases where robots fail, the random generators, and what the watches for divergence and for the targets
    know. ``policy_state_dict`` has the weights of the best policy, where those are not the last ones. On the CPU
    training from it gives the same bits as if it had not been interrupted, with any number of processes if phases are
    not weighted by failures, and with the same number if they are. Where several processes train together, each has a
    state of its own; that of the first is under ``training``.
    """

    env: BufferedVecEnv
    logger: QuietLogger

    def __init__(self, env: BufferedVecEnv, config: PpoConfig, folder: Path, seed: int, ranks: Ranks = ALONE) -> None:
        """Prepare; ``evaluate`` is added where a training is to stop early.

        Args:
            env: The environment that trains: the share of this process.
            config: Settings of the learner.
            folder: Policy folder.
            seed: Seed of the settings.
            ranks: The processes that train together.
        """
        self.ranks = ranks
        super().__init__(
            env, config.runner_settings(seed, env.config.privileged), log_dir=str(folder), device=str(env.device)
        )
        self.config, self.folder = config, PolicyFolder(folder)
        self.logger.__class__ = QuietLogger
        self.logger.steps, self.logger.disable_logs = [], not ranks.is_first
        self.logger.count_faults = lambda: self._earlier_faults + sum(ranks.gathered(env.fault_count()))
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
        if self.ranks.first_decides(self._has_reached_targets):
            return TARGETS
        if iterations <= first:
            return BUDGET
        anneal(self.alg, self.config, first)
        if self.ranks.size > 1:
            self.alg.broadcast_parameters()
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

    def _configure_multi_gpu(self) -> None:
        """Tell RSL-RL which of several processes this is. Its own way insists on NCCL, and so on GPUs."""
        ranks = self.ranks
        self.gpu_world_size, self.gpu_global_rank, self.gpu_local_rank = ranks.size, ranks.rank, ranks.local_rank
        shared = {"global_rank": ranks.rank, "local_rank": ranks.local_rank, "world_size": ranks.size}
        self.cfg["multi_gpu"] = shared if ranks.size > 1 else None
        # It would print a line in each process before it gives all of them the first one's networks, as ``train`` does.
        self.is_distributed = False

    def _has_reached_targets(self) -> bool:
        """Return whether the policy tracks well enough."""
        return self.targets is not None and self.targets.is_reached

    def _after_iteration(self, progress: TrainingProgress, losses: dict[str, float]) -> None:
        """Go on, or stop all processes with a checkpoint, as the first one decides."""
        end = self.ranks.first_decides(lambda: self._look(progress, losses))
        anneal(self.alg, self.config, progress.iteration)
        if end is None:
            return
        self.save(str(self.folder.checkpoint(self.current_learning_iteration)))
        raise end

    def _look(self, progress: TrainingProgress, losses: dict[str, float]) -> Exception | KeyboardInterrupt | None:
        """Watch, evaluate and report an iteration; return why training ends here, if it does.

        Raises:
            TrainingDiverged: it has broken down.
        """
        models = (self.alg.actor, self.alg.critic)
        self.watch.check(progress.iteration, losses, progress.reward, progress.episode_length, models)
        progress = self._evaluate(progress)
        if self._on_progress is not None:
            self._on_progress(progress)
        if self._has_reached_targets():
            return TargetsReached()
        if progress.iteration < progress.total_iterations and self._should_stop():
            path = self.folder.checkpoint(self.current_learning_iteration)
            return TrainingInterrupted(f"stopped after iteration {progress.iteration}; {path} holds all of it")
        return None

    def save(self, path: str, infos: dict[str, Any] | None = None) -> None:
        """Write a checkpoint whole or not at all, and remove those that are no longer needed."""
        if path == self._saved:
            # RSL-RL saves the last iteration once more.
            return
        states = self.ranks.gathered(self._training_state())
        if self.ranks.is_first:
            values = {**self.alg.save(), "iter": self.current_learning_iteration, "infos": infos}
            if self.targets is not None:
                values |= self.targets.policy_weights()
            write_checkpoint(Path(path), {**values, "training": states[0], OTHER_RANKS: states[1:]})
            self.evaluation = self.targets.kept if self.targets is not None else None
            self.folder.keep_newest(KEPT_CHECKPOINTS)
        self._saved = path

    def begin_with(self, policy: PolicyFolder) -> None:
        """Begin with the networks of another policy, those that act, and with a new optimiser.

        Raises:
            PolicyError: they do not fit the settings of this training.
        """
        checkpoint = load_checkpoint(policy.latest_checkpoint(), self.device)
        checkpoint["actor_state_dict"] = acting_weights(checkpoint)
        try:
            self.alg.load(checkpoint, {"actor": True, "critic": True}, True)
        except RuntimeError as error:
            raise PolicyError(f"{policy.path}: does not fit these settings ({str(error).splitlines()[0]})") from None

    def restore(self, checkpoint: dict[str, Any]) -> None:
        """Continue from a checkpoint, at the iteration after the one that it was written at.

        Raises:
            PolicyError: it does not fit the settings of this training.
        """
        try:
            self.alg.load(checkpoint, None, True)
            states = [checkpoint["training"], *checkpoint.get(OTHER_RANKS, [])]
            self._restore_training_state(states[self.ranks.rank])
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
