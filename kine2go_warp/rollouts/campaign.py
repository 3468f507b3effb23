"""Rounds of rollouts of one policy until enough of them are good."""

import shutil
import time
from collections import Counter
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType

import numpy as np
import torch
import warp as wp
from numpy.typing import NDArray

from kine2go_warp.dataset.schema import INITIAL_STATE_ARRAYS
from kine2go_warp.dataset.trajectories import Groups, padded
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.snapshot import WorldSnapshot
from kine2go_warp.env.terrain import reach_of
from kine2go_warp.learning.inference import NoisyPolicy
from kine2go_warp.learning.policy import PolicyFolder, PolicyRecord
from kine2go_warp.learning.vec_env import ImitationVecEnv, share_stream
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.rollouts.config import GatherConfig
from kine2go_warp.rollouts.gather import ProgressCallback
from kine2go_warp.rollouts.quality import Verdict, judge
from kine2go_warp.rollouts.recorder import RolloutRecorder
from kine2go_warp.rollouts.spool import RowSpool
from kine2go_warp.rotations import continuous

JUDGED_AT_ONCE = 64
"""Rollouts in memory while they are judged."""

STEPS_BETWEEN_LOOKS = 64
"""Control steps after which it is looked whether anybody still stands, and progress is told."""


@dataclass(frozen=True)
class Round:
    """What is known of one round besides its rows."""

    spool: RowSpool
    draws: dict[str, NDArray]
    groups: Groups
    verdict: Verdict


@dataclass(frozen=True)
class SpooledRollouts:
    """Some rollouts of several rounds, whose rows stay on the disk until they are asked for."""

    rounds: tuple[Round, ...]
    places: tuple[tuple[int, int], ...]
    """Round and world of each rollout."""
    num_rows: int

    @property
    def num_trajectories(self) -> int:
        """Number of rollouts."""
        return len(self.places)

    @property
    def draws(self) -> dict[str, NDArray]:
        """How each rollout was drawn."""
        return {name: self._picked(lambda one, name=name: one.draws[name]) for name in self.rounds[0].draws}

    @property
    def groups(self) -> Groups:
        """Arrays of the sub-groups."""
        return {
            group: {name: self._picked(lambda one, g=group, n=name: one.groups[g][n]) for name in arrays}
            for group, arrays in self.rounds[0].groups.items()
        }

    def read_rows(self, name: str, first: int, last: int) -> NDArray:
        """Return the rows of some rollouts, shape [last - first, num_rows, ...]."""
        found = []
        for number, one in enumerate(self.rounds):
            worlds = np.array([world for place, world in self.places[first:last] if place == number], dtype=int)
            if len(worlds):
                found.append(read_whole(one.spool, name, worlds, self.num_rows))
        return np.concatenate(found)

    def _picked(self, values) -> NDArray:  # noqa: ANN001 - a function of a round
        """Return a value of each rollout."""
        if not self.places:
            return values(self.rounds[0])[:0]
        return np.stack([values(self.rounds[number])[world] for number, world in self.places])


def read_whole(spool: RowSpool, name: str, worlds: NDArray, num_rows: int) -> NDArray:
    """Return rows of a round; those after its early end are NaN."""
    rows = spool.read(name, worlds).astype(np.float32)
    if rows.shape[1] < num_rows:
        missing = np.full((len(rows), num_rows - rows.shape[1], *rows.shape[2:]), np.nan, np.float32)
        rows = np.concatenate([rows, missing], axis=1)
    return continuous(rows, axis=1) if name.endswith("orientation") else rows


@dataclass
class Tally:
    """What a campaign has cost so far."""

    rows: int = 0
    """State rows simulated."""
    seconds: float = 0.0
    """Time spent on simulation and recording [s]."""
    counts: Counter = field(default_factory=Counter)
    """Rollouts by reason, those accepted under an empty text."""


class Campaign:
    """Rolls a policy out, round by round. Use it as a context manager: it removes its files at the end."""

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
            config: Settings, the number of rows included.
            device: Where to simulate.
            folder: For the rows, until they are in the dataset.
            fault_folder: If given, stop at the first fault of the simulation and save its state here.
        """
        assert config.rows is not None
        self.config, self.num_rows, self.folder = config, config.rows, folder
        share_stream(device)
        settings = config.environment(record.preset.env, config.rows, config.worlds(device))
        self.environment = ImitationEnvironment([clip], settings, device)
        self.ground_reach = reach_of([clip], settings)
        self.env = ImitationVecEnv(self.environment, fault_folder)
        self.actor = NoisyPolicy(self.env, record.preset, policy.latest_checkpoint(), config.seed)
        self.rounds: list[Round] = []
        self._spools = ExitStack()
        self.tally = Tally()

    def __enter__(self) -> "Campaign":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._spools.__exit__(kind, error, traceback)
        shutil.rmtree(self.folder, ignore_errors=True)

    @property
    def num_rollouts(self) -> int:
        """Rollouts run so far."""
        return len(self.rounds) * self.environment.num_worlds

    @property
    def num_accepted(self) -> int:
        """Rollouts that the filter accepted so far."""
        return sum(int(one.verdict.accepted.sum()) for one in self.rounds)

    @property
    def reasons_rejected(self) -> list[str]:
        """Why each rejected rollout was, in order."""
        return [reason for one in self.rounds for reason in one.verdict.reasons if reason]

    @property
    def num_rows_simulated(self) -> int:
        """State rows simulated so far."""
        return self.tally.rows

    @property
    def seconds(self) -> float:
        """Time spent on simulation and recording so far [s]."""
        return self.tally.seconds

    @property
    def num_bytes(self) -> int:
        """Bytes handed to the disk so far."""
        return sum(one.spool.num_bytes for one in self.rounds)

    @property
    def waited(self) -> float:
        """Time for which the simulation has waited for the disk so far [s]."""
        return sum(one.spool.waited for one in self.rounds)

    def accepted(self) -> SpooledRollouts:
        """Return the first rollouts that were accepted, as many as are wanted."""
        return self._chosen(lambda reason: not reason, self.config.trajectories)

    def rejected(self) -> SpooledRollouts:
        """Return all rollouts that were rejected."""
        return self._chosen(bool, None)

    def _chosen(self, wanted, most: int | None) -> SpooledRollouts:  # noqa: ANN001 - a function of a reason
        """Return rollouts by their reasons."""
        places = [
            (number, world)
            for number, one in enumerate(self.rounds)
            for world, reason in enumerate(one.verdict.reasons)
            if wanted(reason)
        ]
        return SpooledRollouts(tuple(self.rounds), tuple(places[:most]), self.num_rows)

    def run(self, on_progress: ProgressCallback | None = None) -> None:
        """Run rounds until enough rollouts are accepted or the budget is spent."""
        budget = self.config.budget * self.config.trajectories
        while self.num_accepted < self.config.trajectories and self.num_rollouts < budget:
            one = self._run_round(len(self.rounds), on_progress)
            self.rounds.append(one)
            self.tally.counts.update(one.verdict.reasons)
            if on_progress is not None:
                on_progress(min(self.num_accepted, self.config.trajectories), self.config.trajectories, self.details())

    def details(self) -> str:
        """Return what has happened so far in words."""
        rejected = {reason: count for reason, count in self.tally.counts.items() if reason}
        named = ", ".join(f"{reason} {count}" for reason, count in rejected.items())
        rate = self.tally.rows / max(self.tally.seconds, 1e-9)
        reasons = f" ({named})" if named else ""
        return f"{self.num_accepted} accepted, {sum(rejected.values())} rejected{reasons}, {rate:,.0f} rows/s"

    def _run_round(self, number: int, on_progress: ProgressCallback | None) -> Round:
        """Run one batch of rollouts and judge it."""
        started = time.perf_counter()
        environment, config = self.environment, self.config
        num_worlds = environment.num_worlds
        environment.restart(config.seed, number * num_worlds)
        self.actor.generator.manual_seed(config.seed + 1_000_003 * number)
        draws = self._draws(number)
        noise = torch.from_numpy(draws["noise"][:, None]).to(self.actor.generator.device)
        spool = self._spools.enter_context(RowSpool(self.folder / f"round-{number}"))
        recorder = RolloutRecorder(environment, spool)
        warm_up = round(config.warm_up * environment.config.control_rate)
        total = warm_up + self.num_rows
        reason = wp.to_torch(environment.episodes.reason)
        failure, survived = torch.zeros_like(reason), torch.zeros_like(reason)
        groups: Groups = {}
        observation = self.env.get_observations()
        for step in range(total):
            if step == warm_up:
                groups = {
                    "randomization": environment.randomization.parameters(),
                    "initial_state": self._initial_state(),
                }
            mean, output = self.actor(observation, noise)
            if step >= warm_up:
                recorder.record_state()
            observation, *_ = self.env.step(output)
            if step >= warm_up:
                recorder.record_action(mean, output)
            failure = torch.where(failure == 0, reason, failure)
            survived += (failure == 0).int()
            if (step + 1) % STEPS_BETWEEN_LOOKS == 0:
                if on_progress is not None:
                    on_progress(self.num_accepted, config.trajectories, self.details())
                if step > warm_up and bool((failure > 0).all()):
                    break
        recorder.finish()
        spool.close()
        # The action of the row in which a rollout failed led to no state, but the row itself is whole.
        length = (survived + (failure > 0).int() - warm_up).clamp(min=0, max=self.num_rows)
        draws["length"] = length.cpu().numpy().astype(np.int32)
        self.tally.rows += num_worlds * max(step + 1 - warm_up, 0)
        self.tally.seconds += time.perf_counter() - started
        verdict = self._judge(spool, draws["length"], failure.cpu().numpy())
        groups["quality"] = verdict.quality
        return Round(spool, draws, groups, verdict)

    def _draws(self, number: int) -> dict[str, NDArray]:
        """Return how each rollout was drawn, read when it begins."""
        episodes, num_worlds = self.environment.episodes, self.environment.num_worlds
        rng = np.random.default_rng([self.config.seed, number])
        return {
            "heading": episodes.placement.heading.numpy().copy(),
            "start_phase": episodes.placement.start_phase.numpy().copy(),
            "seed": episodes.seed.numpy().copy(),
            "noise": rng.uniform(*self.config.noise, num_worlds).astype(np.float32),
        }

    def _initial_state(self) -> dict[str, NDArray]:
        """Return what simulator and motors need to go on from here."""
        snapshot = WorldSnapshot.take(self.environment)
        return {array.name: snapshot.arrays[array.name] for array in INITIAL_STATE_ARRAYS}

    def _judge(self, spool: RowSpool, lengths: NDArray, failures: NDArray) -> Verdict:
        """Judge a round, a few rollouts at a time."""
        verdicts, frame_duration = [], self.environment.config.control_duration
        for first in range(0, len(lengths), JUDGED_AT_ONCE):
            worlds = np.arange(first, min(first + JUDGED_AT_ONCE, len(lengths)))
            rows = {
                name: padded(read_whole(spool, name, worlds, self.num_rows), lengths[worlds]) for name in spool.names
            }
            verdicts.append(judge(rows, failures[worlds], self.config, frame_duration, self.environment.spec))
        quality = {name: np.concatenate([one.quality[name] for one in verdicts]) for name in verdicts[0].quality}
        return Verdict(tuple(reason for one in verdicts for reason in one.reasons), quality)
