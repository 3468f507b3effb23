import json
import math
import shutil

import numpy as np
import pytest

from kine2go_warp.dataset.limit_usage import LimitUsage, filter_limits, limit_usages, row_errors
from kine2go_warp.dataset.motion import Motion, TrajectoryReference
from kine2go_warp.metrics import FILTER_METRICS
from kine2go_warp.rollouts.config import GatherConfig

REFERENCE = TrajectoryReference("trot", 0, 10, {})


def usage_with(figures, limits, stored=math.nan):
    """The limit usage of which only the first figures and limits are known."""
    unknown = (math.nan,) * (len(FILTER_METRICS) - len(figures))
    return LimitUsage(REFERENCE, (*figures, *unknown), (*limits, *unknown), stored)


def test_limits_are_settings_of_the_filter():
    settings = {name for name in vars(GatherConfig()) if name.startswith("max_")}
    assert {limit.setting for limit in FILTER_METRICS} == settings - {"max_attempts"}
    attributes = {"gather_settings": {"max_distance": 0.5, "max_angle": 0.8, "max_joint_rmse": 0.25, "rows": 5}}
    assert filter_limits(attributes)[:3] == (0.5, 0.8, 0.25)
    assert all(math.isnan(limit) for limit in filter_limits(attributes)[3:])


@pytest.mark.parametrize("settings", [None, 3, {}, {"max_distance": "far", "max_angle": True, "max_joint_rmse": 0}])
def test_limits_that_are_not_there_are_not_invented(settings):
    assert all(math.isnan(limit) for limit in filter_limits({"gather_settings": settings}))


def test_the_worst_ratio_is_that_of_the_limit_that_is_closest():
    usage = usage_with((0.1, 0.6, 0.05), (0.5, 0.8, 0.25))
    assert usage.shares[:3] == pytest.approx((0.2, 0.75, 0.2))
    assert (usage.worst_limit_ratio, usage.worst) == (pytest.approx(0.75), "root angle")


def test_a_trajectory_without_limits_comes_first():
    unknown = usage_with((0.1, 0.6, 0.05), (math.nan,) * 3)
    assert (unknown.worst_limit_ratio, unknown.worst) == (math.inf, "")
    partly = usage_with((0.1, 0.6, 0.05), (0.5, math.nan, math.nan))
    assert (partly.worst_limit_ratio, partly.worst) == (pytest.approx(0.2), "root distance")


def test_errors_of_rows_are_distance_angle_and_joints():
    half = np.sqrt(0.5)
    rows = {
        "root_position": np.array([[0.0, 0.0, 0.3], [3.0, 4.0, 0.3]]),
        "reference_root_position": np.array([[0.0, 0.0, 0.3], [0.0, 0.0, 0.3]]),
        "root_orientation": np.array([[1.0, 0.0, 0.0, 0.0], [half, 0.0, 0.0, half]]),
        "reference_root_orientation": np.array([[1.0, 0.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0]]),
        "joint_position": np.zeros((2, 12)),
        "reference_joint_position": np.stack([np.zeros(12), np.full(12, 0.2)]),
    }
    np.testing.assert_allclose(row_errors(rows), [[0.0, 0.0, 0.0], [5.0, np.pi / 2, 0.2]], atol=1e-12)


def test_what_gathering_found_counts_where_it_is_stored():
    usage = usage_with((0.1, 0.6, 0.05), (0.5, 0.8, 0.25), stored=0.9)
    assert (usage.worst_limit_ratio, usage.worst) == (0.9, "root angle")


def test_limit_usages_of_a_dataset_are_those_of_its_filter(clean_dataset):
    motion = Motion(clean_dataset, "dog_trot")
    found = list(limit_usages(motion, motion.references()))
    assert [one.reference.index for one in found] == [0, 1, 2, 3, 4]
    for one in found:
        index = one.reference.index
        assert one.worst_limit_ratio == motion.values("quality/worst_limit_ratio")[index] <= 1.0, "the filter kept it"
        assert one.metrics[7] == motion.values("quality/foot_slip")[index]
        assert one.limits[:3] == (9.0, 3.2, 9.0)
        assert max(one.shares) == pytest.approx(one.worst_limit_ratio, rel=1e-6)
        assert FILTER_METRICS[int(np.argmax(one.shares))].label == one.worst


def test_without_stored_figures_they_come_from_the_rows(clean_dataset, tmp_path):
    stored = usages_of(clean_dataset)
    older = shutil.copytree(clean_dataset, tmp_path / "older.zarr")
    shutil.rmtree(older / "dog_trot" / "quality")
    for path in (older / "zarr.json", older / "dog_trot" / "zarr.json"):
        metadata = json.loads(path.read_text())
        metadata.pop("consolidated_metadata", None)
        path.write_text(json.dumps(metadata))
    for one, before in zip(usages_of(older), stored, strict=True):
        assert one.metrics[:3] == pytest.approx(before.metrics[:3], rel=1e-4)
        assert all(math.isnan(figure) for figure in one.metrics[3:])
        assert one.worst_limit_ratio == max(one.shares[:3])


def usages_of(path):
    motion = Motion(path, "dog_trot")
    return list(limit_usages(motion, motion.references()))
