"""The gathering stage: policy folder in, one motion of a dataset out."""

from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from kine2go_warp import __version__
from kine2go_warp.dataset.quality import tracking_quality
from kine2go_warp.dataset.trajectories import Trajectories, continuous_quaternions
from kine2go_warp.dataset.writer import DatasetWriter, SimulationAttributes
from kine2go_warp.device import choose_device
from kine2go_warp.errors import DatasetError
from kine2go_warp.learning.policy import PolicyFolder, PolicyRecord
from kine2go_warp.motions.catalogue import load_catalogue
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.revision import revision
from kine2go_warp.rollouts.config import GatherConfig
from kine2go_warp.settings import content_hash, to_dictionary

if TYPE_CHECKING:
    from kine2go_warp.env.environment import ImitationEnvironment


DEFAULT_ROWS = 571
"""Rows of a trajectory whose motion is not in the catalogue."""


@dataclass(frozen=True)
class GatherResult:
    """What became of the rollouts of one motion."""

    motion: str
    accepted: int
    rejected: dict[str, int]
    """Number of rejected rollouts by reason."""
    fingerprint: str
    """Hash of policy and settings."""
    is_new: bool
    """Whether the rollouts were run now, rather than found in the dataset."""


def gather(
    policy: PolicyFolder,
    writer: DatasetWriter,
    config: GatherConfig,
    device: str | None = None,
    on_step: Callable[[int, int], None] | None = None,
) -> GatherResult:
    """Roll a policy out in a batch, reject falls and drift, and add the rest to a dataset.

    Args:
        policy: A trained policy.
        writer: The dataset.
        config: Settings.
        device: Where to simulate; by default on CUDA where there is one.
        on_step: Called with the control steps done and their total.

    Raises:
        PolicyError: the policy cannot be read.
        DatasetError: no rollout was accepted.
    """
    record = policy.read_record()
    clip = policy.read_clips(record)[0]
    config = with_rows(config, clip.name)
    fingerprint = gather_fingerprint(policy, config)
    env = record.preset.env
    simulation = SimulationAttributes(env.control_rate, env.substeps, env.motor.stiffness, env.motor.damping)
    writer.check(clip.name, simulation)
    known = writer.attributes(clip.name)
    if known.get("fingerprint") == fingerprint:
        return GatherResult(clip.name, known["accepted"], known["rejected"], fingerprint, is_new=False)
    device = choose_device(device)
    trajectories, failures = roll_out(policy, record, clip, config, device, on_step)
    reasons = rejections(trajectories, failures, config)
    accepted = np.array([reason == "" for reason in reasons])
    rejected = dict(Counter(reason for reason in reasons if reason))
    if not accepted.any():
        found = ", ".join(f"{count} by {reason}" for reason, count in rejected.items())
        raise DatasetError(f"{clip.name}: all {len(accepted)} rollouts were rejected ({found}); train longer")
    attributes = {
        "motion": clip.name,
        **asdict(clip.origin),
        "policy_sha256": policy.checkpoint_hash(),
        "fingerprint": fingerprint,
        "accepted": int(accepted.sum()),
        "rejected": rejected,
        "gather_settings": to_dictionary(config),
        "training_settings": to_dictionary(record.preset),
        "training_seconds": record.seconds,
        "training_iterations": record.iterations,
        "software_version": __version__,
        "software_revision": revision(),
        "device": device,
    }
    writer.write(clip.name, trajectories.selected(accepted), simulation, attributes)
    return GatherResult(clip.name, int(accepted.sum()), rejected, fingerprint, is_new=True)


def with_rows(config: GatherConfig, motion: str) -> GatherConfig:
    """Return the settings with a number of rows: that of the catalogue where none is given."""
    if config.rows is not None:
        return config
    entry = load_catalogue().get(motion)
    return replace(config, rows=entry.length if entry is not None else DEFAULT_ROWS)


def gather_fingerprint(policy: PolicyFolder, config: GatherConfig) -> str:
    """Return a hash of policy and settings."""
    return content_hash(policy.checkpoint_hash(), to_dictionary(config))


def roll_out(
    policy: PolicyFolder,
    record: PolicyRecord,
    clip: MotionClip,
    config: GatherConfig,
    device: str,
    on_step: Callable[[int, int], None] | None,
) -> tuple[Trajectories, NDArray[np.int32]]:
    """Run all rollouts at once.

    Returns:
        The rollouts after the trim, and why each one failed (a number of ``REASON_NAMES``), 0 if it did not.
    """
    import torch
    import warp as wp

    from kine2go_warp.env.environment import ImitationEnvironment
    from kine2go_warp.learning.inference import NoisyPolicy
    from kine2go_warp.learning.vec_env import ImitationVecEnv, share_stream
    from kine2go_warp.rollouts.recorder import RolloutRecorder

    rows = config.rows or DEFAULT_ROWS
    share_stream(device)
    environment = ImitationEnvironment([clip], config.environment(record.preset.env, rows), device)
    env = ImitationVecEnv(environment)
    actor = NoisyPolicy(env, record.preset, policy.latest_checkpoint(), config.noise, config.seed)
    recorder = RolloutRecorder(environment)
    draws = read_draws(environment, config)

    warm_up = round(config.warm_up * environment.config.control_rate)
    total = warm_up + rows
    reason = wp.to_torch(environment.episodes.reason)
    failure = torch.zeros_like(reason)
    survived = torch.zeros_like(reason)
    observation = env.get_observations()
    for step in range(total):
        mean, output = actor(observation)
        if step >= warm_up:
            recorder.record_state()
        observation, *_ = env.step(output)
        if step >= warm_up:
            recorder.record_action(mean, output)
        failure = torch.where(failure == 0, reason, failure)
        survived += (failure == 0).int()
        if on_step is not None:
            on_step(step + 1, total)
    # The action of the row in which a rollout failed led to no state, but the row itself is whole.
    rows_kept = (survived + (failure > 0).int() - warm_up).clamp(min=0)
    draws["length"] = rows_kept.cpu().numpy().astype(np.int32)
    recorded = recorder.rows()
    for name in ("root_orientation", "reference_root_orientation"):
        recorded[name] = continuous_quaternions(recorded[name])
    return Trajectories(recorded, draws), failure.cpu().numpy()


def read_draws(environment: "ImitationEnvironment", config: GatherConfig) -> dict[str, NDArray]:
    """Return how each rollout was drawn, read when it begins."""
    return {
        "heading": environment.episodes.placement.heading.numpy().copy(),
        "start_phase": environment.episodes.placement.start_phase.numpy().copy(),
        "seed": environment.episodes.seed.numpy().copy(),
        "noise": np.full(environment.num_worlds, config.noise, dtype=np.float32),
    }


def rejections(trajectories: Trajectories, failures: NDArray, config: GatherConfig) -> list[str]:
    """Return why each rollout is rejected, an empty text if it is not."""
    from kine2go_warp.kernels.terminations import REASON_NAMES, REASON_NONE

    joint_rmse = np.full(len(failures), np.inf)
    whole = failures == int(REASON_NONE)
    if whole.any():
        joint_rmse[whole] = tracking_quality(trajectories.selected(whole).rows)["joint_rmse"]
    reasons = []
    for failure, rmse in zip(failures, joint_rmse, strict=True):
        if failure != int(REASON_NONE):
            reasons.append(REASON_NAMES[failure])
        else:
            reasons.append("" if rmse <= config.max_joint_rmse else "joint_error")
    return reasons
