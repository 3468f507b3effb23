"""What a training begins with: a new folder, the newest whole checkpoint of one, or a lower learning rate."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from kine2go_warp.errors import PolicyError
from kine2go_warp.files import moved_aside, remove_leftovers
from kine2go_warp.learning.checkpoint import OTHER_RANKS, load_checkpoint
from kine2go_warp.learning.policy import LOCK, PolicyFolder, PolicyRecord
from kine2go_warp.learning.presets import PpoConfig, Preset
from kine2go_warp.motions.clip import MotionClip, robot_of


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

    def check_ranks(self, size: int) -> None:
        """Check that as many processes train together as did before.

        Raises:
            PolicyError: there are more or fewer.
        """
        before = 1 + len(self.checkpoint.get(OTHER_RANKS, []))
        if size != before:
            raise PolicyError(
                f"{self.path}: written by {before} process(es) that trained together, and there are {size} now; "
                f"continue with torchrun --nproc-per-node {before}, or begin a new folder with --initial-policy"
            )


@dataclass(frozen=True)
class Beginning:
    """What a training begins with."""

    record: PolicyRecord
    """What is known of the policy."""
    start: ResumePoint | None
    """Where it continues, if it does."""
    is_finished: bool
    """Whether nothing is left to do."""


def begin(
    policy: PolicyFolder,
    clips: Sequence[MotionClip],
    preset: Preset,
    fingerprint: str,
    overwrite: bool,
    on_note: Callable[[str], None],
) -> Beginning:
    """Prepare a policy folder, and find out where its training continues.

    Args:
        policy: The folder, which no other process writes to (``PolicyFolder.alone``).
        clips: The clips to track.
        preset: Settings.
        fingerprint: Hash of clips and settings.
        overwrite: Start anew if the folder holds a policy of other clips or settings, which is moved aside.
        on_note: Told of damaged checkpoints.

    Raises:
        PolicyError: the folder holds another policy and ``overwrite`` is not given.
    """
    folder, robot = policy.path, robot_of(clips).reference
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
            aside = moved_aside(folder, known.fingerprint if known is not None else "unreadable")
            folder.mkdir()
            # It is locked by this process, and stays so.
            (aside / LOCK).rename(folder / LOCK)
        known, record = None, PolicyRecord(preset, (), fingerprint, 0, 0.0, robot=robot)
    remove_leftovers(folder)
    start = resume_point(policy, preset.ppo.iterations, on_note)
    if known is not None and start is not None and record.complete and known.iterations == start.iterations:
        return Beginning(known, start, is_finished=True)
    hashes = tuple(clip.content_hash() for clip in clips)
    record = replace(record, clips=policy.write_clips(tuple(clips)), clip_hashes=hashes)
    policy.write_record(record)
    return Beginning(record, start, is_finished=False)


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


def resume_point(policy: PolicyFolder, iterations: int, on_note: Callable[[str], None]) -> ResumePoint | None:
    """Return the newest checkpoint that is whole, or none. Those that are not are set aside, with a note.

    Args:
        policy: The folder.
        iterations: How many are wanted; a checkpoint that has them need not hold the state of training.
        on_note: Told of damaged checkpoints.
    """
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
