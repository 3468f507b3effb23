import math

import numpy as np
import pytest

from kine2go_warp.dataset.doubt import LIMITS, Doubt, doubts, filter_limits, row_errors
from kine2go_warp.dataset.motion import Motion, TrajectoryReference
from kine2go_warp.rollouts.config import GatherConfig

REFERENCE = TrajectoryReference("trot", 0, 10, {})


def test_limits_are_settings_of_the_filter():
    assert all(hasattr(GatherConfig(), limit.setting) for limit in LIMITS)
    attributes = {"gather_settings": {"max_distance": 0.5, "max_angle": 0.8, "max_joint_rmse": 0.25, "rows": 5}}
    assert filter_limits(attributes) == (0.5, 0.8, 0.25)


@pytest.mark.parametrize("settings", [None, 3, {}, {"max_distance": "far", "max_angle": True, "max_joint_rmse": 0}])
def test_limits_that_are_not_there_are_not_invented(settings):
    assert all(math.isnan(limit) for limit in filter_limits({"gather_settings": settings}))


def test_doubt_is_the_share_of_the_limit_that_is_closest():
    doubt = Doubt(REFERENCE, (0.1, 0.6, 0.05), (0.5, 0.8, 0.25))
    assert doubt.shares == pytest.approx((0.2, 0.75, 0.2))
    assert (doubt.value, doubt.worst) == (pytest.approx(0.75), "root angle")


def test_a_trajectory_without_limits_is_the_most_doubtful():
    unknown = Doubt(REFERENCE, (0.1, 0.6, 0.05), (math.nan,) * 3)
    assert (unknown.value, unknown.worst) == (math.inf, "")
    partly = Doubt(REFERENCE, (0.1, 0.6, 0.05), (0.5, math.nan, math.nan))
    assert (partly.value, partly.worst) == (pytest.approx(0.2), "root distance")


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


def test_doubts_of_a_dataset_agree_with_its_quality_and_its_filter(clean_dataset):
    motion = Motion(clean_dataset, "dog_trot")
    found = list(doubts(motion, motion.references()))
    assert [one.reference.index for one in found] == [0, 1, 2, 3, 4]
    for one in found:
        index = one.reference.index
        assert one.figures[2] == pytest.approx(motion.values("quality/joint_rmse")[index], rel=1e-4)
        assert one.figures[0] >= motion.values("quality/root_error")[index]
        assert one.figures[1] >= motion.values("quality/root_angle")[index]
        assert one.limits == (9.0, 3.2, 9.0)
        assert one.value <= 1.0, "the filter kept it"
