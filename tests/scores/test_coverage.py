import numpy as np
import pytest

from kine2go_warp.scores.coverage import distances, variance_share


def test_the_share_is_that_of_the_noise_around_a_cycle(rng):
    phase = rng.random(4000)
    cycle = np.stack([np.sin(2 * np.pi * phase), 0.5 * np.cos(4 * np.pi * phase)], axis=-1)
    noisy = cycle + 0.1 * rng.standard_normal(cycle.shape)
    expected = 0.02 / (0.5 + 0.125 + 0.02)
    assert variance_share(noisy, phase, 40.0) == pytest.approx(expected, rel=0.1)
    assert variance_share(cycle, phase, 40.0) < 1e-6


def test_neighbours_are_the_nearest_rows_that_are_far_enough_in_time(rng):
    one, other = rng.standard_normal((150, 12)), rng.standard_normal((300, 12))
    each = np.sqrt(np.mean((one[:, None] - other) ** 2, axis=-1))
    np.testing.assert_allclose(distances(one, other), each.min(axis=1), atol=1e-6)
    own = np.sqrt(np.mean((one[:, None] - one) ** 2, axis=-1))
    own[np.abs(np.subtract.outer(np.arange(150), np.arange(150))) < 20] = np.inf
    np.testing.assert_allclose(distances(one, one, 20), own.min(axis=1), atol=1e-6)
    assert np.isnan(distances(one, one, 1000)).all()
