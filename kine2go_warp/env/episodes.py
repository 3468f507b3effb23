"""The episodes of all worlds: which clip each one tracks from where on, and when and why it ends."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp
from numpy.typing import NDArray

from kine2go_warp.env.clips import make_placement, upload_clips
from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.terrain import HeightField
from kine2go_warp.kernels import launch, phase_sampling, resets
from kine2go_warp.kernels.phase_sampling import PhaseTable
from kine2go_warp.motions.clip import MotionClip


@dataclass(frozen=True)
class EpisodeStart:
    """Where the next episode of each world begins, instead of being drawn; every array has shape [num_worlds]."""

    clip: NDArray[np.int32]
    """Index of the clip."""
    phase: NDArray[np.float32]
    """Phase of the clip, in [0, 1), or less than 0 before the beginning of one that is played once."""
    heading: NDArray[np.float32]
    """Turn of the reference about the world's z axis [rad]."""


class Episodes:
    """Counters, draws and ends of episodes."""

    def __init__(self, clips: Sequence[MotionClip], config: EnvConfig, ground: HeightField, first_world: int) -> None:
        """Allocate; nothing is drawn yet."""
        self.config, self.num_worlds, self.first_world = config, config.num_worlds, first_world
        device = wp.get_device()
        self.clips = upload_clips(clips, config.control_duration, device)
        self.placement = make_placement(self.num_worlds, device)
        self.placement.terrain = ground.upload(device)
        self.spread = 0.0 if config.terrain.is_flat else config.terrain.spread
        self.phase_table = make_phase_table(len(clips), config)

        self.seed = wp.zeros(self.num_worlds, dtype=wp.uint32)
        self.episode = wp.zeros(self.num_worlds, dtype=int)
        self.reference_step = wp.zeros(self.num_worlds, dtype=int)
        self.length = wp.zeros(self.num_worlds, dtype=wp.int64)
        self.world_steps = wp.zeros(self.num_worlds, dtype=int)
        """Control steps of each world over all its episodes, counted only where limits are annealed."""
        self.done = wp.zeros(self.num_worlds, dtype=wp.int64)
        self.time_out = wp.zeros(self.num_worlds, dtype=wp.bool)
        self.reason = wp.zeros(self.num_worlds, dtype=int)
        self.reason_count = wp.zeros(len(config.reason_names), dtype=int)
        self.restart(config.seed)

    def restart(self, seed: int) -> None:
        """Forget everything that has happened, and end all episodes."""
        self.seed.assign(world_seeds(seed, self.num_worlds, self.first_world))
        counters = (self.episode, self.reference_step, self.length, self.world_steps, self.reason_count)
        for counter in (*counters, self.time_out, self.reason):
            counter.zero_()
        forget_failures(self.phase_table)
        self.done.fill_(1)

    def advance(self) -> None:
        """Count one control step."""
        launch(resets.advance_counters, dim=self.num_worlds, inputs=[self.reference_step, self.length])
        if self.config.anneals_limits:
            launch(resets.count_world_steps, dim=self.num_worlds, inputs=[self.world_steps])

    def learn_from_failures(self) -> None:
        """Update the weights of the places where episodes begin. Launched when it is known which worlds are done."""
        sampling, table = self.config.phase_sampling, self.phase_table
        if not sampling.is_weighted:
            return
        lookback = round(sampling.lookback * self.config.control_rate)
        launch(
            phase_sampling.count_phases,
            dim=self.num_worlds,
            inputs=[table, self.clips, self.placement, self.reference_step, lookback, self.done, self.time_out],
        )
        launch(phase_sampling.fade_counts, dim=table.cumulative.shape[0], inputs=[table, sampling.memory])
        phase_sampling.accumulate_probability(table, sampling.uniform_share)

    def reset(self) -> None:
        """Draw clip, phase, heading and place of every world that is done."""
        launch(
            resets.draw_episodes,
            dim=self.num_worlds,
            inputs=[
                self.done,
                self.seed,
                self.episode,
                self.clips,
                self.placement,
                self.phase_table,
                self.spread,
                self.reference_step,
                self.length,
            ],
        )

    def set_starts(self, starts: EpisodeStart) -> None:
        """Begin the episodes that have just been drawn elsewhere in the clips."""
        chosen = [wp.array(starts.clip, dtype=int), wp.array(starts.phase, dtype=float)]
        inputs = [self.done, self.clips, self.placement, *chosen, wp.array(starts.heading, dtype=float)]
        launch(resets.choose_episodes, dim=self.num_worlds, inputs=inputs)


def world_seeds(seed: int, num_worlds: int, first_world: int = 0) -> np.ndarray:
    """Return one independent seed a world, shape [num_worlds]; a world's depends on its number, not on how many."""
    return np.random.SeedSequence(seed).generate_state(first_world + num_worlds, dtype=np.uint32)[first_world:]


def make_phase_table(num_clips: int, config: EnvConfig) -> PhaseTable:  # pyright: ignore[reportGeneralTypeIssues] - a Warp struct
    """Return the bins of all clips. Where failures do not count, a clip is one bin."""
    table = PhaseTable()
    table.bins_per_clip = config.phase_sampling.bins if config.phase_sampling.is_weighted else 1
    count = num_clips * table.bins_per_clip
    table.new_visits, table.new_failures = wp.zeros(count, dtype=int), wp.zeros(count, dtype=int)
    table.visits, table.failures = wp.zeros(count, dtype=float), wp.zeros(count, dtype=float)
    table.weight, table.cumulative = wp.zeros(count, dtype=float), wp.zeros(count, dtype=float)
    return table


def forget_failures(table: PhaseTable) -> None:  # pyright: ignore[reportGeneralTypeIssues] - a Warp struct
    """Make all bins alike."""
    for array in (table.new_visits, table.new_failures, table.visits, table.failures):
        array.zero_()
    count = table.cumulative.shape[0]
    table.cumulative.assign(np.arange(1, count + 1, dtype=np.float32) / count)
