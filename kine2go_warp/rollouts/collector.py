"""Collects rollouts of one policy, batch by batch, until enough of them pass the filter."""

import shutil
import time
import warnings
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from kine2go_warp.dataset.schema import INITIAL_STATE_ARRAYS
from kine2go_warp.dataset.trajectories import Groups
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.episodes import EpisodeStart
from kine2go_warp.env.snapshot import WorldSnapshot
from kine2go_warp.env.terrain import terrain_extent
from kine2go_warp.learning.inference import NoisyPolicy
from kine2go_warp.learning.policy import PolicyFolder, PolicyRecord
from kine2go_warp.learning.vec_env import ImitationVecEnv, share_stream
from kine2go_warp.machine import in_threads
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.rollouts.config import GatherConfig, ProgressCallback
from kine2go_warp.rollouts.diversity import variations
from kine2go_warp.rollouts.quality import FILTER_NEEDS, FilterResult, filter_rollouts
from kine2go_warp.rollouts.rollout import RecordedRollouts, roll_out
from kine2go_warp.rollouts.row_writer import AsyncRowWriter

FILTERED_AT_ONCE = 16
"""Rollouts that a thread has in memory while it filters them."""


@dataclass(frozen=True)
class RolloutBatch:
    """Rollouts that ran at once."""

    recorded: RecordedRollouts
    draws: dict[str, NDArray[Any]]
    groups: Groups
    result: FilterResult
    seconds: float
    """Time spent on simulation and recording [s]."""
    num_bytes: int
    """Bytes given to the disk."""
    waited: float
    """Time for which the simulation waited for the disk [s]."""


@dataclass(frozen=True)
class CollectionStats:
    """What some batches cost and yielded."""

    rollouts: int
    accepted: int
    rejected: dict[str, int]
    """Number of rejected rollouts by reason."""
    rows: int
    """State rows simulated."""
    seconds: float
    """Time spent on simulation and recording [s]."""
    num_bytes: int
    """Bytes given to the disk."""
    waited: float
    """Time for which the simulation waited for the disk [s]."""

    @classmethod
    def of(cls, batches: list[RolloutBatch]) -> "CollectionStats":
        """Add up what some batches cost and yielded."""
        counts = Counter(reason for batch in batches for reason in batch.result.reasons)
        accepted = counts.pop("", 0)
        return cls(
            rollouts=accepted + counts.total(),
            accepted=accepted,
            rejected=dict(counts),
            rows=sum(batch.recorded.rows_simulated for batch in batches),
            seconds=sum(batch.seconds for batch in batches),
            num_bytes=sum(batch.num_bytes for batch in batches),
            waited=sum(batch.waited for batch in batches),
        )

    def __str__(self) -> str:
        named = ", ".join(f"{reason} {count}" for reason, count in self.rejected.items())
        reasons = f" ({named})" if named else ""
        rate = self.rows / max(self.seconds, 1e-9)
        return f"{self.accepted} accepted, {sum(self.rejected.values())} rejected{reasons}, {rate:,.0f} rows/s"


@dataclass(frozen=True)
class CollectedRollouts:
    """Some rollouts of several batches, whose rows stay on the disk until they are read."""

    batches: tuple[RolloutBatch, ...]
    indices: tuple[tuple[int, int], ...]
    """Batch and world of each rollout."""
    num_rows: int

    @property
    def num_trajectories(self) -> int:
        """Number of rollouts."""
        return len(self.indices)

    @property
    def draws(self) -> dict[str, NDArray[Any]]:
        """How each rollout was drawn."""
        return {name: self._picked(lambda batch, name=name: batch.draws[name]) for name in self.batches[0].draws}

    @property
    def groups(self) -> Groups:
        """Arrays of the sub-groups."""
        return {
            group: {name: self._picked(lambda batch, g=group, n=name: batch.groups[g][n]) for name in arrays}
            for group, arrays in self.batches[0].groups.items()
        }

    @property
    def reasons(self) -> list[str]:
        """Why each rollout was rejected, an empty text if it was not."""
        return [self.batches[number].result.reasons[world] for number, world in self.indices]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the row arrays."""
        return self.batches[0].recorded.names

    def read_rows(self, name: str, first: int, last: int) -> NDArray[Any]:
        """Return the rows of some rollouts, shape [last - first, num_rows, ...]."""
        found = []
        for number, batch in enumerate(self.batches):
            worlds = np.array([world for index, world in self.indices[first:last] if index == number], dtype=int)
            if len(worlds):
                found.append(batch.recorded.read(name, worlds))
        return np.concatenate(found)

    def _picked(self, values: Callable[[RolloutBatch], NDArray[Any]]) -> NDArray[Any]:
        """Return a value of each rollout."""
        if not self.indices:
            return values(self.batches[0])[:0]
        return np.stack([values(self.batches[number])[world] for number, world in self.indices])


class RolloutCollector:
    """Rolls a policy out, batch by batch. Use it as a context manager: it removes its files at the end."""

    def __init__(
        self,
        policy: PolicyFolder,
        record: PolicyRecord,
        clip: MotionClip,
        config: GatherConfig,
        device: str,
        folder: Path,
        fault_folder: Path | None = None,
    ) -> None:
        """Build the environment and load the policy.

        Args:
            policy: The policy.
            record: Its settings.
            clip: What it tracks.
            config: Settings, with nothing left open.
            device: Where to simulate.
            folder: For the rows, until they are in the dataset.
            fault_folder: If given, stop at the first fault of the simulation and save its state here.
        """
        assert config.rows is not None
        self.config, self.num_rows, self.folder, self.motion = config, config.rows, folder, clip.name
        share_stream(device)
        self.clip = clip
        settings = config.environment(record.preset.env, config.rows, config.worlds(device))
        # A reference of its own for every world; the ground must hold the fastest.
        clips = [config.diversity.fastest.of(clip)] * (settings.num_worlds if config.diversity.varies_reference else 1)
        self.environment = ImitationEnvironment(clips, settings, device, record_loads=True)
        self.ground_reach = terrain_extent(clips[:1], settings)
        self.env = ImitationVecEnv(self.environment, fault_folder)
        self.actor = NoisyPolicy(self.env, record.preset, policy.latest_checkpoint(), config.seed)
        self.batches: list[RolloutBatch] = []
        self._writers = ExitStack()

    def __enter__(self) -> "RolloutCollector":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._writers.__exit__(kind, error, traceback)
        shutil.rmtree(self.folder, ignore_errors=True)

    @property
    def stats(self) -> CollectionStats:
        """What all batches so far cost and yielded."""
        return CollectionStats.of(self.batches)

    @property
    def policy_std(self) -> list[float]:
        """Standard deviations of the policy in units of the dataset's actions, one a joint."""
        action, spec = self.environment.config.action, self.environment.spec
        scale = 1.0 if action.mode == "absolute" else action.scale
        deviation = self.actor.deviation(self.env.get_observations())
        return (deviation.cpu().double() * scale / spec.action_scale).tolist()

    def accepted(self) -> CollectedRollouts:
        """Return the first rollouts that were accepted, at most as many as are wanted."""
        return self._chosen(accepted=True, most=self.config.trajectories)

    def rejected(self) -> CollectedRollouts:
        """Return all rollouts that were rejected."""
        return self._chosen(accepted=False, most=None)

    def _chosen(self, accepted: bool, most: int | None) -> CollectedRollouts:
        """Return rollouts by what the filter decided."""
        indices = [
            (number, int(world))
            for number, batch in enumerate(self.batches)
            for world in np.flatnonzero(batch.result.accepted == accepted)
        ]
        return CollectedRollouts(tuple(self.batches), tuple(indices[:most]), self.num_rows)

    def run(self, on_progress: ProgressCallback | None = None) -> None:
        """Run batches until enough rollouts are accepted or ``max_attempts`` is reached."""
        wanted, stats = self.config.trajectories, self.stats
        while stats.accepted < wanted and stats.rollouts < self.config.max_attempts * wanted:
            self.batches.append(self._run_batch(len(self.batches), stats, on_progress))
            stats = self.stats
            if on_progress is not None:
                on_progress(min(stats.accepted, wanted), wanted, str(stats))

    def _run_batch(self, number: int, before: CollectionStats, on_progress: ProgressCallback | None) -> RolloutBatch:
        """Run one batch of rollouts and filter it."""
        started = time.perf_counter()
        environment, config = self.environment, self.config
        worlds, actions, scales = round_seeds(config.seed, self.motion, number)
        environment.restart(worlds)
        self.actor.generator.manual_seed(actions)
        rng = np.random.default_rng(scales)
        noise = rng.uniform(*config.action_noise_scale, environment.num_worlds).astype(np.float32)
        drawn = config.diversity.draw(rng, environment.num_worlds)
        starts = self._vary(worlds, drawn)
        seeds = environment.episodes.seed.numpy().copy()
        writer = self._writers.enter_context(AsyncRowWriter(self.folder / f"batch-{number}"))
        groups: Groups = {}

        def first_row() -> None:
            if drawn["recovery"].any():
                environment.begin_episodes(drawn["recovery"] > 0, starts, drawn["reset_scale"])
            groups.update(randomization=environment.randomization.parameters(), initial_state=self._initial_state())

        def progressed(_: int) -> None:
            if on_progress is not None:
                on_progress(before.accepted, config.trajectories, str(before))

        recorded = roll_out(
            self.env,
            self.actor,
            torch.from_numpy(noise[:, None]).to(self.env.device),
            self.num_rows,
            writer,
            round(config.warm_up * environment.config.control_rate),
            first_row,
            progressed,
            config.observations,
        )
        draws = {
            "length": recorded.length,
            "heading": recorded.initial.heading,
            "start_phase": recorded.initial.phase,
            "seed": seeds,
            "noise": noise,
            "terminated": (recorded.failure != "").astype(np.int32),
            **drawn,
        }
        seconds = time.perf_counter() - started
        result = self._filter(recorded, drawn["recovery"] > 0)
        groups.update(quality=result.quality, final_state=recorded.final)
        return RolloutBatch(recorded, draws, groups, result, seconds, writer.num_bytes, writer.waited)

    def _vary(self, worlds: int, drawn: dict[str, NDArray[Any]]) -> EpisodeStart:
        """Let references and policy differ as drawn, and return where the rollouts begin.

        Args:
            worlds: Seed of the worlds, which have just begun with it.
            drawn: Arrays of ``DIVERSITY_ARRAYS``.
        """
        environment, placement = self.environment, self.environment.episodes.placement
        is_varied, is_once = self.config.diversity.varies_reference, self.clip.cycle is None
        clips = np.arange(environment.num_worlds, dtype=np.int32) if is_varied else placement.clip.numpy().copy()
        duration, times = environment.config.control_duration, drawn["noise_time"].astype(np.float64)
        phase = placement.start_phase.numpy().copy()
        if is_once:
            # The warm-up lies before the first frame; recoveries begin anywhere.
            warm_up = round(self.config.warm_up * environment.config.control_rate) * duration
            phase = np.where(drawn["recovery"] > 0, phase, -warm_up / (self.clip.period * drawn["time_scale"]))
        starts = EpisodeStart(clips, phase.astype(np.float32), placement.heading.numpy().copy())
        if is_varied:
            environment.replace_clips([variation.of(self.clip) for variation in variations(drawn)])
        if is_varied or is_once:
            environment.restart(worlds, starts)
        persistence = np.exp(-duration / np.maximum(times, 1e-9)).astype(np.float32)
        self.actor.vary(*(torch.from_numpy(values[:, None]) for values in (drawn["mirrored"], persistence)))
        return starts

    def _initial_state(self) -> dict[str, NDArray[Any]]:
        """Return what simulator and motors need to go on from here."""
        snapshot = WorldSnapshot.take(self.environment)
        return {array.name: snapshot.arrays[array.name] for array in INITIAL_STATE_ARRAYS}

    def _filter(self, recorded: RecordedRollouts, recovery: NDArray[np.bool_]) -> FilterResult:
        """Filter a batch, a few rollouts at a time."""
        frame_duration, count = self.environment.config.control_duration, len(recorded.length)

        def filtered(first: int) -> FilterResult:
            worlds = np.arange(first, min(first + FILTERED_AT_ONCE, count))
            rows = {name: recorded.read(name, worlds) for name in FILTER_NEEDS}
            failures, recovers = recorded.failure[worlds], recovery[worlds]
            return filter_rollouts(rows, failures, self.config, frame_duration, self.environment.spec, recovers)

        with warnings.catch_warnings():
            # Threads that silence warnings put back what they found, in any order.
            parts = list(in_threads(filtered, range(0, count, FILTERED_AT_ONCE)))
        quality = {name: np.concatenate([part.quality[name] for part in parts]) for name in parts[0].quality}
        return FilterResult(tuple(reason for part in parts for reason in part.reasons), quality)


def round_seeds(seed: int, motion: str, number: int) -> tuple[int, int, int]:
    """Return the seeds of worlds, action noise and its scale in a round; no other motion or round has them.

    Args:
        seed: Of the settings.
        motion: Name of the motion.
        number: Of the round, from 0.
    """
    worlds, actions, scales = np.random.SeedSequence([seed, number, *motion.encode()]).generate_state(3, np.uint64)
    return int(worlds), int(actions), int(scales)
