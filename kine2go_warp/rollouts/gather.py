"""The gathering stage: policy folder in, one motion of a dataset out."""

import math
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from kine2go_warp import __version__
from kine2go_warp.dataset.writer import DatasetWriter, RejectedRollouts, SimulationAttributes
from kine2go_warp.device import choose_device
from kine2go_warp.env.mujoco_engine import robot_xml, simulation_record
from kine2go_warp.env.observations import observation_record
from kine2go_warp.errors import DatasetError, PolicyError
from kine2go_warp.learning.policy import PolicyFolder, PolicyRecord
from kine2go_warp.motions.catalogue import DEFAULT_LENGTH, load_catalogue
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.revision import revision
from kine2go_warp.robots.compiled import model_parts
from kine2go_warp.rollouts.config import GatherConfig, ProgressCallback
from kine2go_warp.rollouts.quality import BORDERLINE
from kine2go_warp.settings import content_hash, to_dictionary

if TYPE_CHECKING:
    from kine2go_warp.env.environment import ImitationEnvironment
    from kine2go_warp.rollouts.collector import CollectionStats


@dataclass(frozen=True)
class GatherResult:
    """What became of the rollouts of one motion."""

    motion: str
    accepted: int
    rejected: dict[str, int]
    """Number of rejected rollouts by reason."""
    borderline: tuple[int, ...]
    """Accepted rollouts that are worth a look, those closest to a limit first."""
    fingerprint: str
    """Hash of policy and settings."""
    is_new: bool
    """Whether the rollouts were run now, rather than found in the dataset."""
    rows_per_second: float = 0.0
    """State rows simulated and recorded in a second, if they were run now."""
    megabytes_per_second: float = 0.0
    """What was given to the disk in a second of simulation [MB/s], if it was now."""
    waiting_share: float = 0.0
    """Share of the time for which the simulation waited for the disk, if it ran now."""
    write_time: float = 0.0
    """Time that writing the dataset took afterwards [s], if it was now."""


def gather(
    policy: PolicyFolder,
    writer: DatasetWriter,
    config: GatherConfig,
    device: str | None = None,
    on_progress: ProgressCallback | None = None,
    strict: bool = False,
    clip: MotionClip | None = None,
    catalogue: Path | None = None,
) -> GatherResult:
    """Roll a policy out in batches until enough rollouts are good, and add these to a dataset.

    Args:
        policy: A trained policy.
        writer: The dataset.
        config: Settings.
        device: Where to simulate; by default on CUDA where there is one.
        on_progress: Called now and then.
        strict: Stop at the first fault of the simulation and save its state beside the policy.
        clip: What to track, one of the policy's clips or another; by default its only one.
        catalogue: A user's own, where the motion may state the number of rows.

    Raises:
        PolicyError: the policy cannot be read.
        DatasetError: no rollout was accepted, or fewer than the settings ask for.
    """
    record = policy.read_record()
    clip = only_clip(policy, record) if clip is None else policy.checked_clips(record, [clip])[0]
    env = record.preset.env
    config = settings_for(config, clip, env.control_rate, catalogue)
    fingerprint = gather_fingerprint(policy, record, clip, config)
    simulation = SimulationAttributes(env.control_rate, env.substeps, *env.motor.gains(clip.spec))
    writer.check(clip.name, simulation)
    known = writer.attributes(clip.name)
    if known.get("fingerprint") == fingerprint:
        borderline = tuple(known.get("borderline", ()))
        return GatherResult(clip.name, known["accepted"], known["rejected"], borderline, fingerprint, is_new=False)

    from kine2go_warp.rollouts.collector import RolloutCollector

    device = choose_device(device)
    fault_folder = policy.path if strict else None
    with RolloutCollector(policy, record, clip, config, device, writer.spool(clip.name), fault_folder) as collector:
        collector.run(on_progress)
        stats = collector.stats
        check_acceptance(clip.name, stats, config)
        accepted = collector.accepted()
        usage = accepted.groups["quality"]["worst_limit_ratio"]
        borderline = tuple(int(index) for index in np.argsort(-usage, kind="stable") if usage[index] > BORDERLINE)
        attributes = {
            "motion": clip.name,
            "kind": clip.kind,
            **asdict(clip.origin),
            "fidelity": {} if clip.fidelity is None else clip.fidelity.described(),
            "accepted": accepted.num_trajectories,
            "rejected": stats.rejected,
            "borderline": list(borderline),
            "fingerprint": fingerprint,
            "environment_settings": to_dictionary(collector.environment.config),
            **observations_described(collector.environment, config),
            "ground_reach": collector.ground_reach,
            "policy_std": collector.policy_std,
            "simulation": simulation_record(collector.environment.spec, collector.environment.config),
            "robot_xml": robot_xml(collector.environment.spec, collector.environment.config),
            "model_hash": collector.environment.spec.model_hash,
            "model_parts": model_parts(collector.environment.spec),
            "gather_settings": to_dictionary(config),
            **training_attributes(policy, record),
            "device": device,
        }
        rejected = collector.rejected()
        others = RejectedRollouts(rejected, rejected.reasons) if config.stores_rejected else None
        started = time.perf_counter()
        writer.write(clip.name, accepted, simulation, attributes, others)
        write_time = time.perf_counter() - started
        return GatherResult(
            clip.name,
            accepted.num_trajectories,
            stats.rejected,
            borderline,
            fingerprint,
            is_new=True,
            rows_per_second=stats.rows / stats.seconds,
            megabytes_per_second=stats.num_bytes / 1e6 / stats.seconds,
            waiting_share=stats.waited / stats.seconds,
            write_time=write_time,
        )


def observations_described(environment: "ImitationEnvironment", config: GatherConfig) -> dict[str, object]:
    """Return the attribute that describes the observations, if they are stored."""
    terms = observation_record(environment.config, environment.spec)
    return {"observation_terms": terms} if config.observations else {}


def check_acceptance(motion: str, stats: "CollectionStats", config: GatherConfig) -> None:
    """Check that enough rollouts were accepted.

    Raises:
        DatasetError: too few were.
    """
    if stats.accepted >= max(1, math.ceil(config.min_acceptance * config.trajectories)):
        return
    found = ", ".join(f"{count} by {reason}" for reason, count in stats.rejected.items())
    few = f"{stats.accepted} of {stats.rollouts} rollouts were accepted, too few"
    share = few if stats.accepted else f"all {stats.rollouts} rollouts were rejected"
    raise DatasetError(f"{motion}: {share} ({found}); train longer, or allow more with --max-attempts")


def only_clip(policy: PolicyFolder, record: PolicyRecord) -> MotionClip:
    """Return the only clip that a policy was trained on.

    Raises:
        PolicyError: there are several.
    """
    clip, *others = policy.read_clips(record)
    if others:
        names = ", ".join(one.name for one in (clip, *others))
        raise PolicyError(f"{policy.path}: tracks several clips, name one of: {names}")
    return clip


def training_attributes(policy: PolicyFolder, record: PolicyRecord) -> dict[str, object]:
    """Return what a dataset says of the policy and of the software."""
    return {
        "policy_sha256": policy.checkpoint_hash(),
        "training_settings": to_dictionary(record.preset),
        "training_seconds": record.seconds,
        "training_iterations": record.iterations,
        "training_stopped": record.stop_reason,
        "training_evaluation": {} if record.evaluation is None else record.evaluation.described(),
        "software_version": __version__,
        "software_revision": revision(),
    }


def resolve_settings(config: GatherConfig, motion: str, catalogue: Path | None = None) -> GatherConfig:
    """Return the settings with what they leave open: the catalogue's number of rows, and what the level says."""
    entry = load_catalogue(catalogue).get(motion)
    rows = config.rows or (entry.length if entry is not None else DEFAULT_LENGTH)
    return replace(config, rows=rows, diversity=config.diversity.resolved())


def settings_for(
    config: GatherConfig, clip: MotionClip, control_rate: float, catalogue: Path | None = None
) -> GatherConfig:
    """Return the settings with what they leave open for a clip.

    By default a clip that is played once is recorded from its first frame to its last, at the slowest pace that is
    drawn. No offset is added to its speeds, since its ends are at rest.
    """
    resolved = resolve_settings(config, clip.name, catalogue)
    if clip.cycle is not None:
        return resolved
    diversity = replace(resolved.diversity, speed_offset=(0.0, 0.0), turn_offset=(0.0, 0.0))
    assert diversity.time_scale is not None
    rows = config.rows or math.ceil(clip.period * diversity.time_scale[1] * control_rate - 1e-6) + 1
    return replace(resolved, rows=rows, diversity=diversity)


def gather_fingerprint(policy: PolicyFolder, record: PolicyRecord, clip: MotionClip, config: GatherConfig) -> str:
    """Return a hash of policy, settings, and of a clip that the policy was not trained on."""
    content = clip.content_hash()
    known = record.clip_hashes or [one.content_hash() for one in policy.read_clips(record)]
    others = [] if content in known else [content]
    return content_hash(policy.checkpoint_hash(), to_dictionary(config), *others)
