"""Intervals: where they must lie, how they shrink, how often they cover."""

import numpy as np
import pytest
from scipy.stats import bootstrap

from kine2go_warp.scores.statistics import estimate_mean, estimate_share


def test_the_interval_holds_the_mean_and_shrinks_with_more_trajectories(rng):
    widths = []
    for count in (10, 100, 1000):
        values = rng.normal(size=count)
        estimate = estimate_mean([values])
        assert estimate.value == pytest.approx(values.mean())
        assert estimate.low < estimate.value < estimate.high
        assert estimate.count == count
        widths.append(estimate.high - estimate.low)
    # The width goes with one over the square root of the number.
    np.testing.assert_allclose(widths[1:], np.array(widths[:2]) / np.sqrt(10.0), rtol=0.4)


def test_the_interval_covers_the_truth_about_as_often_as_it_says(rng):
    estimates = [estimate_mean([rng.exponential(size=40)]) for _ in range(200)]
    covered = sum(one.low <= 1.0 <= one.high for one in estimates)
    assert 170 <= covered <= 199, "95 % of 200, a little less for skewed figures"


def test_the_interval_is_scipys(rng):
    values = rng.gamma(2.0, size=25)
    ours = estimate_mean([values])
    theirs = bootstrap((values,), np.mean, n_resamples=9999, method="percentile", rng=rng).confidence_interval
    tolerance = 0.05 * (theirs.high - theirs.low)
    assert ours.low == pytest.approx(theirs.low, abs=tolerance)
    assert ours.high == pytest.approx(theirs.high, abs=tolerance)


def test_each_motion_counts_the_same(rng):
    many, few = rng.normal(0.0, 0.1, 100), rng.normal(10.0, 0.1, 4)
    estimate = estimate_mean([many, few])
    assert estimate.value == pytest.approx((many.mean() + few.mean()) / 2.0)
    assert estimate.high - estimate.low < 0.2, "motions are not drawn again, trajectories are"


def test_the_same_figures_give_the_same_interval(rng):
    values = rng.normal(size=20)
    assert estimate_mean([values]) == estimate_mean([values])


def test_unknown_figures_are_left_out():
    estimate = estimate_mean([np.array([1.0, np.nan, 3.0]), np.array([np.nan])])
    assert (estimate.value, estimate.count) == (2.0, 2)
    assert estimate_mean([np.array([np.nan])]).count == 0
    assert np.isnan(estimate_mean([np.array([np.nan])]).value)


def test_one_trajectory_has_no_interval():
    estimate = estimate_mean([np.array([2.0])])
    assert estimate.value == 2.0
    assert np.isnan([estimate.low, estimate.high]).all()


def test_a_share_has_wilsons_interval_also_where_nothing_failed():
    estimate = estimate_share([np.ones(15, bool), np.ones(5, bool)])
    # Of n successes in n trials the lower end is n / (n + z^2).
    assert estimate.low == pytest.approx(20.0 / (20.0 + 1.959964**2), abs=1e-6)
    assert (estimate.value, estimate.high, estimate.count) == (1.0, pytest.approx(1.0), 20)
    assert estimate_share([np.repeat([True, False], [3, 1])]).value == 0.75
    assert estimate_share([np.array([], bool)]).count == 0
