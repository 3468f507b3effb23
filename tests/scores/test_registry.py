"""All figures on rows of a simulation."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kine2go_warp.dataset.trajectories import Trajectories
from kine2go_warp.metrics import tracking_quality
from kine2go_warp.robots import GO2
from kine2go_warp.scores.registry import METRICS, Rollouts

TRACKING = [metric for metric in METRICS if metric.name in {
    "joint_mse", "joint_rmse", "root_error", "root_angle", "foot_error", "foot_error_in_base", "joint_emd", "body_emd"
}]  # fmt: skip


@pytest.fixture
def rollouts(simulated):
    return Rollouts.of(simulated, GO2)


def test_names_are_unique_and_texts_are_there():
    names = [metric.name for metric in METRICS]
    assert len(set(names)) == len(names)
    assert all(metric.unit and metric.description for metric in METRICS)


@pytest.mark.parametrize("metric", METRICS, ids=lambda metric: metric.name)
def test_every_figure_of_a_simulation_is_finite_and_not_negative(metric, rollouts):
    values = metric.compute(rollouts)
    assert values.shape == (4,)
    assert np.isfinite(values).all()
    assert (values >= 0.0).all()


def test_tracking_figures_are_those_that_the_dataset_stores(rollouts):
    stored = tracking_quality(rollouts.rows)
    for name, values in stored.items():
        metric = next(metric for metric in METRICS if metric.name == name)
        np.testing.assert_allclose(metric.compute(rollouts), values, rtol=1e-5)


def test_a_perfect_rollout_has_no_tracking_error(rollouts):
    rows = dict(rollouts.rows)
    for name in ("root_position", "root_orientation", "joint_position"):
        rows[name] = rows[f"reference_{name}"]
    rows["link_position"] = rows["link_position"].copy()
    rows["link_position"][:, :, 12:] = rows["reference_foot_position"]
    assert len(TRACKING) == 8
    for metric in TRACKING:
        np.testing.assert_allclose(metric.compute(replace(rollouts, rows=rows)), 0.0, atol=1e-6, err_msg=metric.name)


def test_a_distance_of_distributions_is_below_the_error_in_time(rollouts):
    by_name = {metric.name: metric.compute(rollouts) for metric in METRICS}
    assert (by_name["joint_emd"] <= by_name["joint_rmse"]).all()


def test_padding_changes_no_figure(rollouts):
    """A trajectory that is cut short has the figures of its first rows, alone or beside longer ones."""
    length = rollouts.length.copy()
    length[0] = 25
    padded = Trajectories(dict(rollouts.rows), {"length": length}).padded().rows
    alone = {name: values[:1, :25] for name, values in rollouts.rows.items()}
    for metric in METRICS:
        if not metric.is_share:
            both = metric.compute(replace(rollouts, rows=padded, length=length))
            one = metric.compute(replace(rollouts, rows=alone, length=length[:1]))
            np.testing.assert_allclose(both[0], one[0], rtol=1e-9, err_msg=metric.name)
            np.testing.assert_allclose(both[1:], metric.compute(rollouts)[1:], rtol=1e-9, err_msg=metric.name)


def test_rollouts_are_counted_as_the_gathering_counted_them(simulated):
    attributes = simulated.attributes | {"accepted": 4, "rejected": {"distance": 2, "body_contact": 1}}
    counted = Rollouts.of(replace(simulated, attributes=attributes), GO2)
    assert (counted.accepted, counted.rejected) == (4, 3)
    assert counted.frame_duration == pytest.approx(1.0 / 60.0)


def test_survival_and_acceptance_count_rollouts(rollouts):
    length = rollouts.length.copy()
    length[0] = 25
    counted = replace(rollouts, length=length, accepted=4, rejected=12)
    by_name = {metric.name: metric.compute(counted) for metric in METRICS if metric.is_share}
    assert by_name["survival"].mean() == 0.75
    assert by_name["acceptance"].mean() == 0.25


def test_turning_and_moving_everything_changes_nothing(rollouts):
    """Figures do not depend on where the rollout was, or in which direction it went."""
    turn, shift = Rotation.from_euler("z", 1.1), np.array([4.0, -2.0, 0.0])
    rows = {}
    for name, values in rollouts.rows.items():
        moved = values.astype(np.float64)
        if name.endswith("orientation"):
            turned = turn * Rotation.from_quat(moved.reshape(-1, 4)[:, [1, 2, 3, 0]])
            moved = turned.as_quat()[:, [3, 0, 1, 2]].reshape(moved.shape)
        elif moved.shape[-1] == 3:
            moved = turn.apply(moved.reshape(-1, 3)).reshape(moved.shape)
            moved += shift if name.endswith(("root_position", "link_position", "foot_position")) else 0.0
        rows[name] = moved
    for metric in METRICS:
        moved = metric.compute(replace(rollouts, rows=rows))
        np.testing.assert_allclose(moved, metric.compute(rollouts), rtol=1e-4, atol=1e-6, err_msg=metric.name)
