"""The training stage: clips in, policy folder out."""

import contextlib
import io
import shutil
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from kine2go_warp.device import choose_device, choose_processes
from kine2go_warp.errors import PolicyError
from kine2go_warp.learning.config import TrainConfig
from kine2go_warp.learning.policy import PolicyFolder, PolicyRecord
from kine2go_warp.learning.presets import Preset
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.settings import content_hash, to_dictionary


def training_fingerprint(clips: Sequence[MotionClip], preset: Preset) -> str:
    """Return a hash of everything that decides which policy training ends with, but for its length."""
    settings = to_dictionary(replace(preset, ppo=replace(preset.ppo, iterations=0)))
    return content_hash([clip.content_hash() for clip in clips], settings)


def train(
    clips: Sequence[MotionClip],
    config: TrainConfig,
    folder: Path,
    device: str | None = None,
    overwrite: bool = False,
    on_progress: Callable[..., None] | None = None,
    processes: int | None = None,
    strict: bool = False,
) -> PolicyRecord:
    """Train a policy, or continue a training that was interrupted.

    Args:
        clips: The clips to track.
        config: Settings.
        folder: Policy folder. One of the same clips and settings is continued from its newest checkpoint.
        device: Where to train; by default on CUDA where there is one.
        overwrite: Start anew if the folder holds a policy of other clips or settings, which is moved aside.
        on_progress: Called with a ``TrainingProgress`` after each iteration.
        processes: How many processes share the simulation; by default one a core on a CPU. It changes no result.
        strict: Stop at the first fault of the simulation and save its state, instead of counting it. One process.

    Raises:
        PolicyError: the folder holds another policy and ``overwrite`` is not given, or two clips have the same name.
    """
    names = sorted(clip.name for clip in clips)
    if len(set(names)) < len(names):
        raise PolicyError(f"each clip needs a name of its own, but they are: {', '.join(names)}")
    device = choose_device(device)
    preset = config.resolve(device)
    fingerprint = training_fingerprint(clips, preset)
    policy = PolicyFolder(folder)
    known = known_record(policy, overwrite)
    if known is not None and known.fingerprint == fingerprint:
        if known.iterations >= preset.ppo.iterations:
            return known
        record = replace(known, preset=preset)
    else:
        if policy.exists and not overwrite:
            raise PolicyError(
                f"{folder}: holds a policy of other clips or settings; choose another folder or pass --overwrite"
            )
        if policy.exists or policy.checkpoints():
            set_aside(folder, known.fingerprint if known is not None else "unreadable")
        folder.mkdir(parents=True, exist_ok=True)
        record = PolicyRecord(preset, (), fingerprint, 0, 0.0)
    record = replace(record, clips=policy.write_clips(tuple(clips)))
    policy.write_record(record)
    processes = 1 if strict else choose_processes(processes, preset.env.num_worlds, device)
    return _run(policy, record, clips, device, on_progress, processes, strict)


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


def set_aside(folder: Path, suffix: str) -> None:
    """Move a policy folder that is in the way to a name beside it: hours of training are not for deleting."""
    older = folder.with_name(f"{folder.name}.{suffix}")
    shutil.rmtree(older, ignore_errors=True)
    folder.rename(older)


def _run(
    policy: PolicyFolder,
    record: PolicyRecord,
    clips: Sequence[MotionClip],
    device: str,
    on_progress: Callable[..., None] | None,
    processes: int,
    strict: bool,
) -> PolicyRecord:
    """Run PPO from the newest checkpoint on and record how far it came, also when it is interrupted."""
    import torch

    from kine2go_warp.env.environment import ImitationEnvironment
    from kine2go_warp.learning.parallel import ParallelVecEnv
    from kine2go_warp.learning.runner import ImitationRunner
    from kine2go_warp.learning.vec_env import ImitationVecEnv, share_stream

    share_stream(device)
    torch.manual_seed(record.preset.env.seed)
    if processes > 1:
        env = ParallelVecEnv(clips, record.preset.env, processes)
    else:
        environment = ImitationEnvironment(clips, record.preset.env, device)
        env = ImitationVecEnv(environment, policy.path if strict else None)
    with contextlib.redirect_stdout(io.StringIO()):
        runner = ImitationRunner(env, record.preset.ppo, policy.path, record.preset.env.seed)
    if policy.checkpoints():
        runner.restore(policy.latest_checkpoint())
    started, before = time.monotonic(), record.seconds
    try:
        runner.train(record.preset.ppo.iterations, on_progress)
    finally:
        record = replace(record, iterations=policy.iterations_done(), seconds=before + time.monotonic() - started)
        policy.write_record(record)
        env.close()
    for outdated in policy.checkpoints()[:-1]:
        outdated.unlink()
    return record
