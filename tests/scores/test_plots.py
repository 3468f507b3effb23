"""What the pictures show, and that they are small and whole."""

from dataclasses import replace

import numpy as np
import pytest

from kine2go_warp.dataset.trajectories import Trajectories
from kine2go_warp.scores.plots import PHASE_BINS, compute_curves, draw, draw_coverage, draw_phase, quantiles_by_phase


@pytest.fixture
def curves(simulated):
    return compute_curves(simulated)


def test_quantiles_are_taken_in_bins_of_the_phase(rng):
    phase, values = rng.random((3, 400)), rng.random((3, 400))
    values[1, 100:] = np.nan
    result = quantiles_by_phase(phase, values)
    for one in (0, 13, PHASE_BINS - 1):
        inside = (phase >= one / PHASE_BINS) & (phase < (one + 1) / PHASE_BINS) & ~np.isnan(values)
        np.testing.assert_allclose(result[:, one], np.quantile(values[inside], [0.1, 0.5, 0.9]))


def test_bins_without_rows_are_empty():
    result = quantiles_by_phase(np.array([[0.5, 1.0]]), np.array([[2.0, 3.0]]))
    assert np.isnan(result).all(axis=0).sum() == PHASE_BINS - 2
    assert result[1, -1] == 3.0, "rounding may give a phase of 1"


def test_curves_hold_one_path_a_trajectory_without_padding(simulated):
    length = simulated.trajectories.draws["length"].copy()
    length[1] = 25
    cut = Trajectories(simulated.trajectories.rows, {"length": length}).padded()
    curves = compute_curves(replace(simulated, trajectories=cut))
    assert [len(path) for path in curves.paths] == [len(heading) for heading in curves.headings] == length.tolist()
    for path, rows in zip(curves.paths, cut.rows["root_position"], strict=True):
        np.testing.assert_allclose(path, rows[: len(path), :2])
    assert draw_coverage(curves).axes[0].get_xlim()[0] > -100.0, "finite limits"


def test_every_trajectory_is_drawn_with_its_heading(curves):
    axes = draw_coverage(curves).axes[0]
    drawn = [line.get_xydata() for line in axes.lines if len(line.get_xydata()) > 1]
    assert len(drawn) == 4
    np.testing.assert_allclose(drawn[1], curves.paths[1])
    arrows = [one for one in axes.collections if type(one).__name__ == "Quiver"]
    directions = np.arctan2(arrows[3].V, arrows[3].U)
    assert directions[-1] == pytest.approx(curves.headings[3][-1], abs=1e-6)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x [m]", "y [m]")


def test_errors_have_units_and_the_median_is_drawn(curves):
    joint, root, legs = draw_phase(curves).axes
    assert (joint.get_ylabel(), root.get_ylabel()) == ("joint RMSE [rad]", "root error [cm]")
    np.testing.assert_allclose(root.lines[0].get_ydata(), 100.0 * curves.root_error[1])
    assert legs.get_ylabel() == "leg distance [cm]"
    np.testing.assert_allclose(legs.lines[0].get_ydata(), 100.0 * curves.leg_distance[1])


def test_the_least_leg_distance_by_phase_is_that_of_the_rows(simulated, curves):
    phase, distance = (simulated.trajectories.rows[name] for name in ("phase", "leg_distance"))
    inside = (phase >= 10 / PHASE_BINS) & (phase < 11 / PHASE_BINS)
    np.testing.assert_allclose(curves.leg_distance[1, 10], np.median(distance[inside]), rtol=1e-6)


def test_legs_that_overlap_stay_within_the_picture(curves):
    overlapping = replace(curves, leg_distance=curves.leg_distance - 1.0)
    legs = draw_phase(overlapping).axes[2]
    assert legs.get_ylim()[0] <= 100.0 * np.nanmin(overlapping.leg_distance)


def test_pictures_are_small_and_nothing_else_is_left(curves, tmp_path):
    paths = draw(curves, tmp_path / "plots")
    assert sorted(path.name for path in (tmp_path / "plots").iterdir()) == [
        "dog_trot_coverage.png",
        "dog_trot_phase.png",
    ]
    for path in paths:
        assert path.read_bytes().startswith(b"\x89PNG")
        assert path.stat().st_size < 150_000
