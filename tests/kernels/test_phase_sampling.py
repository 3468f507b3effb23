import numpy as np
import pytest
import warp as wp

from kine2go_warp.env.clips import make_placement, upload_clips
from kine2go_warp.kernels.phase_sampling import (
    PhaseTable,
    accumulate_probability,
    count_phases,
    fade_counts,
    find_bin,
)


@wp.kernel
def find_bins(table: PhaseTable, numbers: wp.array(dtype=float), found: wp.array(dtype=int)):
    index = wp.tid()
    found[index] = find_bin(table, numbers[index])


def make_table(num_bins, bins_per_clip):
    table = PhaseTable()
    table.bins_per_clip = bins_per_clip
    with wp.ScopedDevice(wp.get_device()):
        table.new_visits, table.new_failures = wp.zeros(num_bins, dtype=int), wp.zeros(num_bins, dtype=int)
        table.visits, table.failures = wp.zeros(num_bins, dtype=float), wp.zeros(num_bins, dtype=float)
        table.weight, table.cumulative = wp.zeros(num_bins, dtype=float), wp.zeros(num_bins, dtype=float)
    return table


def test_a_bin_is_found_as_numpy_finds_it(rng):
    table = make_table(13, 13)
    cumulative = np.cumsum(rng.dirichlet(np.ones(13))).astype(np.float32)
    table.cumulative.assign(cumulative)
    numbers = rng.uniform(0.0, 0.999, 1000).astype(np.float32)
    found = wp.zeros(1000, dtype=int)
    wp.launch(find_bins, dim=1000, inputs=[table, wp.array(numbers), found])
    np.testing.assert_array_equal(found.numpy(), np.searchsorted(cumulative, numbers, side="right"))


def test_visits_count_where_a_world_is_and_failures_a_moment_before(clip):
    table, device = make_table(20, 20), wp.get_device()
    placement = make_placement(3, device)
    placement.start_phase.assign(np.float32([0.0, 0.5, 0.95]))
    steps, per_step = np.array([12, 12, 12]), (1.0 / 60.0) / clip.frame_duration / clip.num_frames
    inputs = [
        table,
        upload_clips([clip], 1.0 / 60.0, device),
        placement,
        wp.array(np.int32(steps), device=device),
        5,
        wp.array(np.int64([0, 1, 1]), device=device),
        wp.array(np.array([False, False, True]), dtype=wp.bool, device=device),
    ]
    wp.launch(count_phases, dim=3, inputs=inputs, device=device)
    phases = (np.array([0.0, 0.5, 0.95]) + steps * per_step) % 1.0
    expected = np.bincount((phases * 20).astype(int), minlength=20)
    np.testing.assert_array_equal(table.new_visits.numpy(), expected)
    cause = (0.5 + 7 * per_step) % 1.0
    expected = np.bincount([int(cause * 20)], minlength=20)
    np.testing.assert_array_equal(table.new_failures.numpy(), expected, err_msg="a time-out is no failure")


def test_beyond_its_end_a_clip_played_once_counts_in_its_last_bin_and_before_its_beginning_in_its_first(once_clip):
    table, device = make_table(10, 10), wp.get_device()
    placement = make_placement(4, device)
    placement.start_phase.assign(np.float32([0.0, 0.97, 0.5, -0.4]))
    steps = np.int32([0, 5, 4 * once_clip.num_frames, 3])
    flags = [wp.zeros(4, dtype=kind, device=device) for kind in (wp.int64, wp.bool)]
    clips = upload_clips([once_clip], 1.0 / 60.0, device)
    inputs = [table, clips, placement, wp.array(steps, device=device), 5, *flags]
    wp.launch(count_phases, dim=4, inputs=inputs, device=device)
    np.testing.assert_array_equal(table.new_visits.numpy(), [2, 0, 0, 0, 0, 0, 0, 0, 0, 2])


@pytest.mark.parametrize("uniform_share", [0.0, 0.3, 1.0])
def test_probabilities_are_a_uniform_share_and_the_failure_rates(uniform_share, rng):
    table = make_table(40, 20)
    visits, failures = rng.uniform(10.0, 100.0, 40), rng.uniform(0.0, 10.0, 40)
    table.visits.assign(np.float32(visits))
    table.failures.assign(np.float32(failures))
    wp.launch(fade_counts, dim=40, inputs=[table, 1.0])
    accumulate_probability(table, uniform_share)
    rate = (failures + 1.0) / (visits + 1.0)
    expected = uniform_share / 40 + (1.0 - uniform_share) * rate / rate.sum()
    np.testing.assert_allclose(np.diff(table.cumulative.numpy(), prepend=0.0), expected, atol=2e-7, rtol=1e-4)


def test_old_counts_fade():
    table = make_table(2, 2)
    for count in (4, 0, 0):
        table.new_visits.assign(np.int32([count, 0]))
        table.new_failures.assign(np.int32([0, count]))
        wp.launch(fade_counts, dim=2, inputs=[table, 0.5])
    np.testing.assert_allclose(table.visits.numpy(), [1.0, 0.0])
    np.testing.assert_allclose(table.failures.numpy(), [0.0, 1.0])
