import numpy as np
import pytest

from kine2go_warp.scores.coverage import by_cycle, nearest, variance_share


def test_the_share_is_that_of_the_noise_around_a_cycle(rng):
    phase = rng.random(4000)
    cycle = np.stack([np.sin(2 * np.pi * phase), 0.5 * np.cos(4 * np.pi * phase)], axis=-1)
    noisy = cycle + 0.1 * rng.standard_normal(cycle.shape)
    expected = 0.02 / (0.5 + 0.125 + 0.02)
    assert variance_share(noisy, phase, 40.0) == pytest.approx(expected, rel=0.1)
    assert variance_share(cycle, phase, 40.0) < 1e-6


def test_neighbours_are_the_nearest_cycles_at_equal_phase(rng):
    shift = rng.normal(0.0, 0.1, (2, 6))

    def trajectory(start, cycle_shift):
        turns = start + np.arange(150) / 30.3
        wave = np.sin(2 * np.pi * turns)[:, None] * np.ones(12)
        return by_cycle(turns, wave + cycle_shift[np.floor(turns).astype(int)][:, None])

    one, other = trajectory(0.0, 0.0 * shift[0]), trajectory(0.013, shift[1])
    # Cycles that differ by constants jump between them, where a spline rings; the middle is as it should be.
    middle = slice(16, 48)
    assert np.nanmax(nearest(one)[:, middle]) < 1e-4
    expected = np.abs(shift[1, :5]).min()
    np.testing.assert_allclose(nearest(one, other)[1:4, middle], expected, atol=2e-3)
    assert np.isnan(nearest(one[:1])).all()
