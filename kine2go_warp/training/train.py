"""The training stage: clips in, policy folder out."""

import contextlib
import functools
import io
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kine2go_warp.device import choose_processes, fitting
from kine2go_warp.errors import PolicyError, TrainingDiverged
from kine2go_warp.learning.policy import PolicyFolder, PolicyRecord
from kine2go_warp.learning.presets import Preset
from kine2go_warp.learning.stopping import DIVERGED, TargetWatch
from kine2go_warp.machine import core_seconds
from kine2go_warp.motions.clip import MotionClip, robot_of
from kine2go_warp.robots import DEFAULT_ROBOT
from kine2go_warp.settings import content_hash, to_dictionary
from kine2go_warp.training.beginning import Beginning, ResumePoint, begin, begin_again, slower
from kine2go_warp.training.ranks import ALONE, Ranks

if TYPE_CHECKING:
    from kine2go_warp.learning.vec_env import BufferedVecEnv
    from kine2go_warp.training.watching import TrainingObserver


def training_fingerprint(clips: Sequence[MotionClip], preset: Preset) -> str:
    """Return a hash of everything that decides which policy training ends with, but for its length."""
    settings = deciding_settings(preset)
    del settings["ppo"]["iterations"]
    if preset.stopping.interval == 0:
        del settings["stopping"]
    parts = [[clip.content_hash() for clip in clips], settings]
    if clips[0].robot != DEFAULT_ROBOT:
        # Policies of the Go2 may be older than the choice of a robot.
        parts.append(robot_of(clips).training_values)
    return content_hash(*parts)


def deciding_settings(preset: Preset) -> dict[str, Any]:
    """Return the settings that decide what a training ends with: the initial policy by its weights, not by its folder.

    Raises:
        PolicyError: there is no such policy.
    """
    settings = to_dictionary(preset)
    del settings["preset"]
    if folder := settings.pop("initial_policy"):
        settings["initial_policy"] = PolicyFolder(Path(folder)).checkpoint_hash()
    return settings


def with_initial_networks(preset: Preset, robot: str) -> Preset:
    """Return the settings with networks of the size of the initial policy's, if there is one.

    Raises:
        PolicyError: it cannot be read, drives another robot, or observes other things than the settings say.
    """
    if not preset.initial_policy:
        return preset
    from kine2go_warp.env.observations import observation_layout

    record = PolicyFolder(Path(preset.initial_policy)).read_record()
    if record.robot != robot:
        raise PolicyError(f"{preset.initial_policy}: drives the robot {record.robot}, and the clips are for {robot}")
    if observation_layout(record.preset.env) != observation_layout(preset.env):
        raise PolicyError(
            f"{preset.initial_policy}: observes other things than these settings; use those of its preset"
        )
    known = record.preset.ppo
    networks = {name: getattr(known, name) for name in ("hidden_dims", "activation", "obs_normalization")}
    return replace(preset, ppo=replace(preset.ppo, **networks))


def train(
    clips: Sequence[MotionClip],
    preset: Preset,
    folder: Path,
    device: str | None = None,
    overwrite: bool = False,
    on_progress: Callable[..., None] | None = None,
    processes: int | None = None,
    strict: bool = False,
    should_stop: Callable[[], bool] | None = None,
    on_note: Callable[[str], None] = warnings.warn,
    observer: "TrainingObserver | None" = None,
) -> PolicyRecord:
    """Train a policy, or continue a training that was interrupted.

    It ends when the policy meets the targets of ``preset.stopping``, at the latest after ``preset.ppo.iterations``.
    Where it is evaluated, the policy that acts is the best one, not the last.

    What is continued goes on exactly: on the CPU, with torch using as many threads, it ends with the same bits as a
    training that was never interrupted, also if it was asked for fewer iterations at first. A damaged checkpoint is set
    aside, and the one before it is continued. A training that diverges begins again once, learning more slowly.

    Where torchrun has started several processes, each simulates its share of the worlds and all learn from all of them;
    see ``Ranks``. As many must continue what they began.

    Args:
        clips: The clips to track.
        preset: Settings. As many worlds as suit the device where their number is left open.
        folder: Policy folder. One of the same clips and settings is continued from its newest checkpoint.
        device: Where to train; by default on CUDA where there is one.
        overwrite: Start anew if the folder holds a policy of other clips or settings, which is moved aside.
        on_progress: Called with a ``TrainingProgress`` after each iteration.
        processes: How many processes share the simulation; by default one a core on a CPU. It changes no result, but
            where failures weigh the phases at which episodes begin: such a training is continued with as many
            processes as it began with, whatever is given here.
        strict: Stop at the first fault of the simulation and save its state, instead of counting it. One process.
        should_stop: Asked after each iteration, such as a ``StopRequest``; if it says yes, a checkpoint is written.
        on_note: Told what the user should know: damaged checkpoints, a restart.
        observer: Receives some worlds and the curves. It changes no result.

    Raises:
        PolicyError: the folder holds another policy and ``overwrite`` is not given, another process trains in it, two
            clips have the same name, or the processes that torchrun has started cannot share the training.
        ClipError: the clips are for different robots.
        TrainingDiverged: it diverged again after the restart.
        TrainingInterrupted: ``should_stop`` said so; the same call continues.
    """
    names = sorted(clip.name for clip in clips)
    if len(set(names)) < len(names):
        raise PolicyError(f"each clip needs a name of its own, but they are: {', '.join(names)}")
    robot, ranks = robot_of(clips).reference, Ranks.of_torchrun()
    device = ranks.device(device)
    preset = with_initial_networks(preset.on(device), robot)
    ranks.share(preset.env)
    if ranks.size > 1 and (strict or processes not in (None, 1)):
        raise PolicyError("processes that torchrun has started take neither --processes nor --strict; leave them out")
    choose_processes(processes, preset.env.num_worlds, device)
    fingerprint, policy = training_fingerprint(clips, preset), PolicyFolder(folder)
    with ranks.connected(device), contextlib.ExitStack() as until_the_end:

        def beginning() -> Beginning:
            until_the_end.enter_context(policy.alone())
            return begin(policy, clips, preset, fingerprint, overwrite, on_note)

        begun = ranks.first_decides(beginning)
        if begun.is_finished:
            return begun.record
        if begun.start is not None:
            begun.start.check_ranks(ranks.size)
        task = TrainingTask(policy, clips, device, processes, strict, on_progress, should_stop, observer, ranks)
        return task.run_or_begin_again(begun, on_note)


@dataclass(frozen=True)
class TrainingTask:
    """All that stays the same when training begins again."""

    policy: PolicyFolder
    clips: Sequence[MotionClip]
    device: str
    processes: int | None
    strict: bool
    on_progress: Callable[..., None] | None
    should_stop: Callable[[], bool] | None
    observer: "TrainingObserver | None" = None
    ranks: Ranks = ALONE

    def run_or_begin_again(self, begun: Beginning, on_note: Callable[[str], None]) -> PolicyRecord:
        """Run PPO, and once more, learning more slowly, if it diverges.

        Raises:
            TrainingDiverged: it has diverged twice.
            TrainingInterrupted: ``should_stop`` said so.
        """
        policy, record, start = self.policy, begun.record, begun.start
        while True:
            try:
                return self.run(record, start)
            except TrainingDiverged as error:
                if record.restarts:
                    if self.ranks.is_first:
                        policy.write_record(replace(policy.read_record(), stop_reason=DIVERGED))
                    raise TrainingDiverged(
                        f"{policy.path}: training diverged, again after a restart: {error}"
                    ) from None
                reason = str(error)
            # Outside the handler, which would keep the first attempt's worlds in memory.
            again = functools.partial(begin_again, policy, reason, on_note)
            record, start = self.ranks.first_decides(again), None

    def run(self, record: PolicyRecord, start: ResumePoint | None) -> PolicyRecord:
        """Run PPO from a checkpoint or from the beginning, and record how far it came, also if it is interrupted."""
        import torch

        from kine2go_warp.learning.vec_env import share_stream
        from kine2go_warp.training.runner import ImitationRunner
        from kine2go_warp.training.tracking import TrackingEvaluator
        from kine2go_warp.training.watching import attach_observer

        policy, preset, ranks = self.policy, record.preset, self.ranks
        ppo = slower(preset.ppo) if record.restarts else preset.ppo
        share_stream(self.device)
        torch.manual_seed(preset.env.seed + ranks.rank)
        started, core_started, before, reason = time.monotonic(), core_seconds(), record, ""
        stopping = preset.stopping
        closing_environment = contextlib.closing(self._environment(preset, start))
        with fitting(preset.env.num_worlds, self.device), closing_environment as env:
            with contextlib.redirect_stdout(io.StringIO()):
                runner = ImitationRunner(env, ppo, policy.path, preset.env.seed, ranks)
            if ranks.is_first and stopping.is_active(ppo.iterations):
                evaluator = TrackingEvaluator(self.clips, preset.env, stopping, self.device)
                runner.evaluate_with(evaluator, TargetWatch(stopping))
            if start is not None:
                runner.restore(start.checkpoint)
            elif preset.initial_policy:
                runner.begin_with(PolicyFolder(Path(preset.initial_policy)))
            on_progress = self.on_progress
            if ranks.is_first and self.observer is not None:
                done = runner.current_learning_iteration * ppo.num_steps_per_env
                on_progress = attach_observer(env, self.observer, on_progress, done)
            try:
                reason = runner.train(ppo.iterations, on_progress, self.should_stop)
            finally:
                seconds = before.seconds + time.monotonic() - started
                core = before.core_seconds + core_seconds() - core_started
                record = replace(record, iterations=policy.iterations_done(), seconds=seconds, core_seconds=core)
                record = replace(record, stop_reason=reason, evaluation=runner.evaluation)
                if ranks.is_first:
                    policy.write_record(record)
        if ranks.is_first:
            policy.keep_newest(1)
        return ranks.first_decides(lambda: record)

    def _environment(self, preset: Preset, start: ResumePoint | None) -> "BufferedVecEnv":
        """Build this process' share of the worlds, simulated by as many processes as wanted or needed."""
        from kine2go_warp.env.environment import ImitationEnvironment
        from kine2go_warp.learning.vec_env import ImitationVecEnv
        from kine2go_warp.training.parallel import ParallelVecEnv

        needed = start.processes if start is not None else None
        if self.strict and needed not in (None, 1):
            raise PolicyError(
                f"{self.policy.path}: was begun by {needed} processes, each with its own weights of phases, and strict "
                "training runs in one; choose another folder"
            )
        alone = self.strict or self.ranks.size > 1
        processes = 1 if alone else needed or self.processes
        count = choose_processes(processes, preset.env.num_worlds, self.device)
        if count > 1:
            return ParallelVecEnv(self.clips, preset.env, count)
        share = self.ranks.share(preset.env)
        first_world = self.ranks.rank * share.num_worlds
        environment = ImitationEnvironment(self.clips, share, self.device, first_world=first_world)
        return ImitationVecEnv(environment, self.policy.path if self.strict else None)
