"""The training stage: clips in, policy folder out."""

import contextlib
import io
import shutil
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from kine2go_warp.device import choose_device
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
) -> PolicyRecord:
    """Train a policy, or continue a training that was interrupted.

    Args:
        clips: The clips to track.
        config: Settings.
        folder: Policy folder. One of the same clips and settings is continued from its newest checkpoint.
        device: Where to train; by default on CUDA where there is one.
        overwrite: Start anew if the folder holds a policy of other clips or settings.
        on_progress: Called with a ``TrainingProgress`` after each iteration.

    Raises:
        PolicyError: the folder holds another policy and ``overwrite`` is not given.
    """
    device = choose_device(device)
    preset = config.resolve(device)
    fingerprint = training_fingerprint(clips, preset)
    policy = PolicyFolder(folder)
    record = PolicyRecord(preset, (), fingerprint, 0, 0.0)
    if policy.exists:
        known = policy.read_record()
        if known.fingerprint == fingerprint and known.preset.ppo.iterations <= preset.ppo.iterations:
            record = replace(known, preset=preset)
        elif not overwrite:
            raise PolicyError(
                f"{folder}: holds a policy of other clips or settings; choose another folder or pass --overwrite"
            )
        else:
            shutil.rmtree(folder)
    if record.complete:
        return record
    folder.mkdir(parents=True, exist_ok=True)
    record = replace(record, clips=policy.write_clips(tuple(clips)))
    policy.write_record(record)
    return _run(policy, record, clips, device, on_progress)


def _run(
    policy: PolicyFolder,
    record: PolicyRecord,
    clips: Sequence[MotionClip],
    device: str,
    on_progress: Callable[..., None] | None,
) -> PolicyRecord:
    """Run PPO from the newest checkpoint on and record how far it came, also when it is interrupted."""
    import torch

    from kine2go_warp.env.environment import ImitationEnvironment
    from kine2go_warp.learning.runner import ImitationRunner
    from kine2go_warp.learning.vec_env import ImitationVecEnv, share_stream

    share_stream(device)
    torch.manual_seed(record.preset.env.seed)
    environment = ImitationEnvironment(clips, record.preset.env, device)
    with contextlib.redirect_stdout(io.StringIO()):
        runner = ImitationRunner(ImitationVecEnv(environment), record.preset.ppo, policy.path, record.preset.env.seed)
    if policy.checkpoints():
        runner.restore(policy.latest_checkpoint())
    started, before = time.monotonic(), record.seconds
    runner.train(record.preset.ppo.iterations, on_progress)
    for outdated in policy.checkpoints()[:-1]:
        outdated.unlink()
    record = replace(record, iterations=record.preset.ppo.iterations, seconds=before + time.monotonic() - started)
    policy.write_record(record)
    return record
