"""Where episodes begin: more often where the robot has failed recently.

Every clip is cut into bins of equal length. For each bin it is counted how many worlds pass and how many fail in it
or soon after; the share of failures, smoothed over time, weighs how often an episode begins there.
"""

import warp as wp

from kine2go_warp.kernels import launch
from kine2go_warp.kernels.reference import Placement, ReferenceClips, turns_at, whole_cycles


@wp.struct
class PhaseTable:
    """Bins of all clips, one clip after another; shape [num_clips * bins_per_clip] each."""

    bins_per_clip: int
    new_visits: wp.array(dtype=int)
    """Worlds that passed in the present control step."""
    new_failures: wp.array(dtype=int)
    """Worlds that failed in the present control step."""
    visits: wp.array(dtype=float)
    """Visits, older ones fading."""
    failures: wp.array(dtype=float)
    """Failures, older ones fading."""
    weight: wp.array(dtype=float)
    """Share of failures, and then probability that an episode begins in this bin."""
    cumulative: wp.array(dtype=float)
    """Probability that an episode begins in this bin or an earlier one."""


@wp.func
def find_bin(table: PhaseTable, number: float) -> int:
    """Return the first bin whose cumulative probability exceeds a number in [0, 1)."""
    low = int(0)
    high = table.cumulative.shape[0] - 1
    while low < high:
        middle = (low + high) // 2
        if number < table.cumulative[middle]:
            high = middle
        else:
            low = middle + 1
    return low


@wp.func
def bin_at(table: PhaseTable, clips: ReferenceClips, placement: Placement, world: int, step: int) -> int:
    """Return the bin in which a world is ``step`` control steps into its episode."""
    clip = placement.clip[world]
    turns = turns_at(clips, placement, world, float(step))
    within = int((turns - whole_cycles(clips, clip, turns)) * float(table.bins_per_clip))
    return clip * table.bins_per_clip + wp.min(within, table.bins_per_clip - 1)


@wp.kernel
def count_phases(
    table: PhaseTable,
    clips: ReferenceClips,
    placement: Placement,
    reference_step: wp.array(dtype=int),
    lookback: int,
    done: wp.array(dtype=wp.int64),
    time_out: wp.array(dtype=wp.bool),
):
    """Count each world where it is, and each failure ``lookback`` control steps before it. Launched over [num_worlds].

    Whole numbers: their sum does not depend on the order in which a GPU adds them.
    """
    world = wp.tid()
    step = reference_step[world]
    wp.atomic_add(table.new_visits, bin_at(table, clips, placement, world, step), 1)
    if done[world] != wp.int64(0) and not time_out[world]:
        cause = wp.max(step - lookback, 0)
        wp.atomic_add(table.new_failures, bin_at(table, clips, placement, world, cause), 1)


@wp.kernel
def fade_counts(table: PhaseTable, memory: float):
    """Add the new counts to the old ones, which fade by the factor ``memory``; weigh by failure rate. Over all bins."""
    phase_bin = wp.tid()
    table.visits[phase_bin] = memory * table.visits[phase_bin] + float(table.new_visits[phase_bin])
    table.failures[phase_bin] = memory * table.failures[phase_bin] + float(table.new_failures[phase_bin])
    table.new_visits[phase_bin] = 0
    table.new_failures[phase_bin] = 0
    table.weight[phase_bin] = failure_rate(table, phase_bin)


@wp.func
def failure_rate(table: PhaseTable, phase_bin: int) -> float:
    """Return the share of visits that failed [-]; one failure is presumed where nobody has been yet."""
    return (table.failures[phase_bin] + 1.0) / (table.visits[phase_bin] + 1.0)


@wp.kernel
def weigh_bins(table: PhaseTable, uniform_share: float):
    """Turn failure rates and their sums into probabilities: a share is spread evenly, the rest by failure rate.

    Launched over all bins.
    """
    phase_bin = wp.tid()
    count = table.cumulative.shape[0]
    by_rate = (1.0 - uniform_share) * table.weight[phase_bin] / table.cumulative[count - 1]
    table.weight[phase_bin] = uniform_share / float(count) + by_rate


def accumulate_probability(table: PhaseTable, uniform_share: float) -> None:  # pyright: ignore[reportGeneralTypeIssues] - a Warp struct
    """Write the cumulative probabilities from the failure rates, in parallel: there may be hundreds of clips."""
    wp.utils.array_scan(table.weight, table.cumulative)
    launch(weigh_bins, dim=table.cumulative.shape[0], inputs=[table, uniform_share])
    wp.utils.array_scan(table.weight, table.cumulative)
