"""The training stage: clips in, policy folder out."""

import contextlib
import io
import os
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kine2go_warp.device import choose_device, choose_processes, fitting
from kine2go_warp.errors import PolicyError, TrainingDiverged
from kine2go_warp.files import moved_aside, remove_leftovers
from kine2go_warp.learning.policy import PolicyFolder, PolicyRecord
from kine2go_warp.learning.presets import PpoConfig, Preset
from kine2go_warp.learning.stopping import DIVERGED, TargetWatch
from kine2go_warp.machine import core_seconds
from kine2go_warp.motions.clip import MotionClip, robot_of
from kine2go_warp.robots import DEFAULT_ROBOT
from kine2go_warp.settings import content_hash, to_dictionary

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
        PolicyError: the folder holds another policy and ``overwrite`` is not given, two clips have the same name, or
            torchrun has started several processes.
        ClipError: the clips are for different robots.
        TrainingDiverged: it diverged again after the restart.
        TrainingInterrupted: ``should_stop`` said so; the same call continues.
    """
    names = sorted(clip.name for clip in clips)
    if len(set(names)) < len(names):
        raise PolicyError(f"each clip needs a name of its own, but they are: {', '.join(names)}")
    check_alone()
    robot = robot_of(clips).reference
    device = choose_device(device)
    preset = with_initial_networks(preset.on(device), robot)
    choose_processes(processes, preset.env.num_worlds, device)
    fingerprint = training_fingerprint(clips, preset)
    policy = PolicyFolder(folder)
    known = known_record(policy, overwrite)
    if known is not None and known.fingerprint == fingerprint:
        record = replace(known, preset=preset)
    else:
        if policy.exists and not overwrite:
            of = (
                "other clips or settings"
                if known is None or known.robot == robot
                else f"another robot, {known.robot}, not {robot}"
            )
            raise PolicyError(f"{folder}: holds a policy of {of}; choose another folder or pass --overwrite")
        if policy.exists or policy.checkpoints():
            # Hours of training are not for deleting.
            moved_aside(folder, known.fingerprint if known is not None else "unreadable")
        folder.mkdir(parents=True, exist_ok=True)
        known, record = None, PolicyRecord(preset, (), fingerprint, 0, 0.0, robot=robot)
    remove_leftovers(folder)
    start = resume_point(policy, preset.ppo.iterations, on_note)
    if known is not None and start is not None and record.complete and known.iterations == start.iterations:
        return known
    hashes = tuple(clip.content_hash() for clip in clips)
    record = replace(record, clips=policy.write_clips(tuple(clips)), clip_hashes=hashes)
    policy.write_record(record)
    task = TrainingTask(policy, clips, device, processes, strict, on_progress, should_stop, observer)
    while True:
        try:
            return task.run(record, start)
        except TrainingDiverged as error:
            if record.restarts:
                policy.write_record(replace(policy.read_record(), stop_reason=DIVERGED))
                raise TrainingDiverged(f"{folder}: training diverged, again after a restart: {error}") from None
            reason = str(error)
        # Outside the handler, which would keep the first attempt's worlds in memory.
        record, start = begin_again(policy, reason, on_note), None


def check_alone() -> None:
    """Check that torchrun has not started this process beside others, which would write the same policy.

    Raises:
        PolicyError: it has.
    """
    processes = os.environ.get("WORLD_SIZE", "1")
    if processes not in ("", "1"):
        raise PolicyError(
            f"WORLD_SIZE is {processes}, as torchrun sets it, and one training runs on one GPU; "
            "'kine2go run' trains as many motions at once as there are GPUs"
        )


def known_record(policy: PolicyFolder, overwrite: bool) -> PolicyRecord | None:
    """Return the record of the policy that is there, if any; an unreadable one counts as none if it may go.

    Raises:
        PolicyError: it cannot be read and may not be overwritten.
    """
    if not policy.exists:
        return None
    try:
        return policy.read_record()
    except PolicyError:
        if not overwrite:
            raise
        return None


@dataclass(frozen=True)
class ResumePoint:
    """Where training continues."""

    path: Path
    """The checkpoint."""
    checkpoint: dict[str, Any]
    """What it holds, on the CPU."""

    @property
    def iterations(self) -> int:
        """Iterations done."""
        return self.checkpoint["iter"] + 1

    @property
    def processes(self) -> int | None:
        """How many processes it must be continued with, none if any number will do."""
        tables = self.checkpoint["training"]["phases"].values()
        return next((len(table) for table in tables), None)


def resume_point(policy: PolicyFolder, iterations: int, on_note: Callable[[str], None]) -> ResumePoint | None:
    """Return the newest checkpoint that is whole, or none. Those that are not are set aside, with a note.

    Args:
        policy: The folder.
        iterations: How many are wanted; a checkpoint that has them need not hold the state of training.
        on_note: Told of damaged checkpoints.
    """
    from kine2go_warp.learning.checkpoint import load_checkpoint

    found = policy.checkpoints()
    for path in reversed(found):
        try:
            checkpoint = load_checkpoint(path, "cpu")
            if checkpoint["iter"] + 1 < iterations and "training" not in checkpoint:
                raise PolicyError(f"{path}: holds no state of the training to continue")
        except PolicyError as error:
            path.rename(path.with_name(f"{path.name}.damaged"))
            then = "continuing from the one before" if path != found[0] else "starting anew"
            on_note(f"{error}; set aside, {then}")
        else:
            return ResumePoint(path, checkpoint)
    return None


def begin_again(policy: PolicyFolder, reason: str, on_note: Callable[[str], None]) -> PolicyRecord:
    """Set a training that has diverged aside, and return the record of a new one that learns more slowly."""
    aside = policy.set_attempt_aside()
    record = replace(policy.read_record(), restarts=1, restart_reason=reason, iterations=0)
    policy.write_record(record)
    rate = slower(record.preset.ppo).learning_rate
    on_note(f"training diverged ({reason}); starting again with a learning rate of {rate:.2g}; {aside} keeps the log")
    return record


def slower(ppo: PpoConfig) -> PpoConfig:
    """Return the settings of a restart: a third of the learning rate, half the step that it is adapted to."""
    return replace(ppo, learning_rate=ppo.learning_rate / 3.0, desired_kl=ppo.desired_kl / 2.0)


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

    def run(self, record: PolicyRecord, start: ResumePoint | None) -> PolicyRecord:
        """Run PPO from a checkpoint or from the beginning, and record how far it came, also if it is interrupted."""
        import torch

        from kine2go_warp.learning.vec_env import share_stream
        from kine2go_warp.training.runner import ImitationRunner
        from kine2go_warp.training.tracking import TrackingEvaluator
        from kine2go_warp.training.watching import attach_observer

        policy, preset = self.policy, record.preset
        ppo = slower(preset.ppo) if record.restarts else preset.ppo
        share_stream(self.device)
        torch.manual_seed(preset.env.seed)
        started, core_started, before, reason = time.monotonic(), core_seconds(), record, ""
        stopping = preset.stopping
        closing_environment = contextlib.closing(self._environment(preset, start))
        with fitting(preset.env.num_worlds, self.device), closing_environment as env:
            with contextlib.redirect_stdout(io.StringIO()):
                runner = ImitationRunner(env, ppo, policy.path, preset.env.seed)
            if stopping.is_active(ppo.iterations):
                evaluator = TrackingEvaluator(self.clips, preset.env, stopping, self.device)
                runner.evaluate_with(evaluator, TargetWatch(stopping))
            if start is not None:
                runner.restore(start.checkpoint)
            elif preset.initial_policy:
                runner.begin_with(PolicyFolder(Path(preset.initial_policy)))
            on_progress = self.on_progress
            if self.observer is not None:
                done = runner.current_learning_iteration * ppo.num_steps_per_env
                on_progress = attach_observer(env, self.observer, on_progress, done)
            try:
                reason = runner.train(ppo.iterations, on_progress, self.should_stop)
            finally:
                seconds = before.seconds + time.monotonic() - started
                core = before.core_seconds + core_seconds() - core_started
                record = replace(record, iterations=policy.iterations_done(), seconds=seconds, core_seconds=core)
                record = replace(record, stop_reason=reason, evaluation=runner.evaluation)
                policy.write_record(record)
        policy.keep_newest(1)
        return record

    def _environment(self, preset: Preset, start: ResumePoint | None) -> "BufferedVecEnv":
        """Build the environment, in as many processes as wanted or needed."""
        from kine2go_warp.env.environment import ImitationEnvironment
        from kine2go_warp.learning.vec_env import ImitationVecEnv
        from kine2go_warp.training.parallel import ParallelVecEnv

        needed = start.processes if start is not None else None
        if self.strict and needed not in (None, 1):
            raise PolicyError(
                f"{self.policy.path}: was begun by {needed} processes, each with its own weights of phases, and strict "
                "training runs in one; choose another folder"
            )
        processes = 1 if self.strict else needed or self.processes
        count = choose_processes(processes, preset.env.num_worlds, self.device)
        if count > 1:
            return ParallelVecEnv(self.clips, preset.env, count)
        environment = ImitationEnvironment(self.clips, preset.env, self.device)
        return ImitationVecEnv(environment, self.policy.path if self.strict else None)
