"""The filter against made-up rollouts whose figures are known."""

from dataclasses import replace

import numpy as np
import pytest

from kine2go_warp.dataset.schema import QUALITY_ARRAYS
from kine2go_warp.env.terms.terminations import TERMINATIONS
from kine2go_warp.metrics import FILTER_METRICS, settled_rows
from kine2go_warp.robots import GO2
from kine2go_warp.rollouts.config import GatherConfig
from kine2go_warp.rollouts.diversity import DiversitySettings
from kine2go_warp.rollouts.quality import BORDERLINE, filter_rollouts

ROWS, FRAME = 20, 1.0 / 60.0
CONFIG = GatherConfig()


def perfect(count=1):
    """Rollouts that stand in the default pose, exactly where the reference is."""

    def still(*values):
        return np.tile(np.array(values, dtype=np.float32), (count, ROWS, 1))

    links = np.zeros((count, ROWS, 16, 3), np.float32)
    links[:, :, 12:, 2] = -0.2
    pose = still(*GO2.default_joint_position)
    return {
        "root_position": still(0, 0, 0.3),
        "reference_root_position": still(0, 0, 0.3),
        "root_orientation": still(1, 0, 0, 0),
        "root_angular_velocity": still(0, 0, 0),
        "reference_root_orientation": still(1, 0, 0, 0),
        "joint_position": pose,
        "reference_joint_position": pose.copy(),
        "joint_target": pose.copy(),
        "joint_velocity": np.zeros_like(pose),
        "torque_at_limit": np.zeros_like(pose),
        "link_position": links,
        "link_linear_velocity": np.zeros_like(links),
        "reference_foot_position": links[:, :, 12:].copy(),
        "foot_contact_force": np.tile(np.float32([0, 0, 40]), (count, ROWS, 4, 1)),
        "leg_contact": np.zeros((count, ROWS), np.float32),
        "reference_body_rests": np.zeros((count, ROWS), np.float32),
        "leg_distance": np.full((count, ROWS), 0.05, np.float32),
    }


def too_far(rows, one=0):
    rows["root_position"][one, 7, 0] = 0.6


def turned(rows, one=0):
    rows["root_orientation"][one, 7] = (np.cos(0.5), 0, 0, np.sin(0.5))


def joints_off(rows, one=0):
    rows["reference_joint_position"][one] += 0.3


def on_its_legs(rows, one=0):
    rows["leg_contact"][one, 3:8] = 1.0


def at_a_limit(rows, one=0):
    shift = GO2.joint_lower[2] - rows["joint_position"][one, :, 2]
    rows["joint_position"][one, :, 2] += shift
    rows["reference_joint_position"][one, :, 2] += shift


def saturated_torque(rows, one=0):
    rows["torque_at_limit"][one, :, 3:5] = 1.0


def targets_beyond_limits(rows, one=0):
    rows["joint_target"][one, :, 6:9] = np.float32(GO2.joint_upper)[6:9] + 0.1


def slipping(rows, one=0):
    rows["link_linear_velocity"][one, :, :, 0] = 0.5


def shaking(rows, one=0):
    rows["joint_velocity"][one] = 3.0 * (-1.0) ** np.arange(ROWS)[:, None]


def too_fast(rows, one=0):
    # The other joints and rows are still: the mean jerk stays below its limit.
    rows["joint_velocity"][one, 9:12, 2] = (12.0, 1.5 * GO2.joint_speed[2], 12.0)


def legs_crossed(rows, one=0):
    rows["leg_distance"][one, 4] = -0.02


FAULTS = {
    "distance": (too_far, 0.6),
    "rotation": (turned, 1.0),
    "joint_error": (joints_off, 0.3),
    "leg_contact": (on_its_legs, 5 / 20),
    "joint_limit": (at_a_limit, 1 / 12),
    "torque_saturation": (saturated_torque, 2 / 12),
    "action_saturation": (targets_beyond_limits, 3 / 12),
    "foot_slip": (slipping, 0.5),
    "jerk": (shaking, 4 * 3.0 * 60.0**2),
    "joint_speed": (too_fast, 1.5),
    "leg_overlap": (legs_crossed, 0.02),
}
"""What spoils a rollout, and its figure by hand, in the order in which the limits are looked at."""


def filtered(rows, failures=None, config=CONFIG):
    count = len(rows["leg_contact"])
    return filter_rollouts(rows, np.full(count, "") if failures is None else np.array(failures), config, FRAME, GO2)


def test_a_perfect_rollout_uses_nothing_of_its_limits():
    result = filtered(perfect())
    assert result.reasons == ("",)
    assert result.accepted.tolist() == [True]
    assert result.quality["worst_limit_ratio"] == pytest.approx(0.0, abs=1e-6)
    assert set(result.quality) == {array.name for array in QUALITY_ARRAYS}


@pytest.mark.parametrize("reason", FAULTS)
def test_each_limit_rejects_for_its_own_reason_and_no_other_rollout(reason):
    spoil, expected = FAULTS[reason]
    rows = perfect(3)
    spoil(rows, 1)
    result = filtered(rows)
    assert result.reasons == ("", reason, "")
    name, setting = next((one.name, one.setting) for one in FILTER_METRICS if one.reason == reason)
    assert result.quality[name][1] == pytest.approx(expected, rel=1e-4)
    assert result.quality["worst_limit_ratio"][1] == pytest.approx(expected / getattr(CONFIG, setting), rel=1e-4)


@pytest.mark.parametrize("first", range(len(FAULTS)))
def test_of_several_faults_the_first_in_order_counts(first):
    rows = perfect()
    for spoil, _ in list(FAULTS.values())[first:]:
        spoil(rows)
    assert filtered(rows).reasons == (list(FAULTS)[first],)


def test_every_limit_has_a_fault_here_in_the_same_order():
    assert [one.reason for one in FILTER_METRICS] == list(FAULTS)


def test_a_figure_at_its_limit_is_accepted_and_one_above_is_not():
    rows = perfect(2)
    rows["leg_contact"][0, 3], rows["leg_contact"][1, 3:5] = 1.0, 1.0
    config = GatherConfig(max_leg_contact=float(np.float32(1 / 20)))
    assert filtered(rows, config=config).reasons == ("", "leg_contact")


def test_legs_may_touch_the_ground_where_the_reference_rests_there_and_nowhere_else():
    rows = perfect(2)
    for one in range(2):
        on_its_legs(rows, one)
    rows["reference_body_rests"][0, 3:8] = 1.0
    rows["reference_body_rests"][1, 10:15] = 1.0
    result = filtered(rows)
    assert result.reasons == ("", "leg_contact")
    np.testing.assert_allclose(result.quality["leg_contact"], (0.0, 5 / 20))


def test_worst_limit_ratio_is_the_largest_share_of_a_limit():
    rows = perfect(3)
    rows["root_position"][0, 7, 1] = 0.45  # 0.9 of 0.5 m
    rows["reference_joint_position"][0] += 0.15  # 0.6 of 0.25 rad
    rows["link_linear_velocity"][1, :, :, 1] = 0.3  # 0.75 of 0.4 m/s
    rows["root_position"][2, 7, 1] = 0.1  # 0.2 of 0.5 m
    result = filtered(rows, config=GatherConfig(max_distance=0.5, max_joint_rmse=0.25, max_foot_slip=0.4))
    np.testing.assert_allclose(result.quality["worst_limit_ratio"], (0.9, 0.75, 0.2), rtol=1e-5)
    assert result.accepted.all()
    assert (result.quality["worst_limit_ratio"] > BORDERLINE).tolist() == [True, False, False]


def test_rows_beyond_the_end_do_not_count():
    rows = perfect(2)
    for spoil in (too_far, turned, joints_off, shaking):
        spoil(rows)
    whole = filtered({name: values[:, :6] for name, values in rows.items()})
    for values in rows.values():
        values[:, 6:] = np.nan
    result = filtered(rows)
    assert result.reasons == ("joint_error", "")
    for name, values in result.quality.items():
        np.testing.assert_allclose(values, whole.quality[name], rtol=1e-6, err_msg=name)


def test_a_rollout_without_rows_keeps_the_reason_of_its_failure(recwarn):
    rows = perfect(2)
    for values in rows.values():
        values[1] = np.nan
    result = filtered(rows, ["", "body_contact"])
    assert result.reasons == ("", "body_contact")
    assert np.isnan(result.quality["worst_limit_ratio"][1])
    assert result.quality["worst_limit_ratio"][0] == pytest.approx(0.0, abs=1e-6)
    assert not list(recwarn)


def test_figures_that_are_not_numbers_are_never_accepted():
    rows = perfect()
    rows["torque_at_limit"][:] = np.nan
    assert filtered(rows).reasons == ("torque_saturation",)


@pytest.mark.parametrize("failure", [term.name for term in TERMINATIONS])
def test_a_failure_of_the_simulation_comes_before_every_limit(failure):
    rows = perfect()
    for spoil, _ in FAULTS.values():
        spoil(rows)
    assert filtered(rows, [failure]).reasons == (failure,)
    assert filtered(perfect(), [failure]).reasons == (failure,)


def test_rows_are_settled_some_time_after_a_recovery_and_after_each_hard_push():
    push = np.zeros((3, 10, 3))
    push[1, 2, 1], push[1, 8, 0], push[2, 2, 0] = 0.3, -0.5, 0.15
    settled = settled_rows(push, np.array([True, False, False]), 3)
    numbers = [np.flatnonzero(one).tolist() for one in settled]
    # A push comes right after its row; that of 0.15 m/s is not hard.
    assert numbers == [[3, 4, 5, 6, 7, 8, 9], [0, 1, 2, 6, 7, 8], list(range(10))]


def test_the_way_back_is_not_judged_but_for_legs_in_one_another():
    config = replace(CONFIG, diversity=DiversitySettings("cloning", recovery_time=4 * FRAME))
    rows = perfect(5) | {"push": np.zeros((5, ROWS, 3), np.float32)}
    for one, off in ((0, 0.5), (1, 0.5), (4, 0.7)):
        rows["root_position"][one, 7, 0] = off
        rows["joint_position"][one, 6:9] += 0.5
    rows["push"][[0, 4], 5, 0] = 0.5
    rows["leg_distance"][2, 1] = -0.02
    rows["root_position"][3, 2, 0] = 0.5
    recovery = np.array([False, False, True, True, False])
    result = filter_rollouts(rows, np.full(5, ""), config, FRAME, GO2, recovery)
    # On the way back 1.5 times the limit of 0.4 m is allowed.
    assert result.reasons == ("", "distance", "leg_overlap", "", "distance")
    assert result.quality["largest_root_error"][0] == pytest.approx(0.5), "metrics are those of all rows"
    assert result.quality["worst_limit_ratio"][0] == pytest.approx(0.5 / 0.6)
    paper = filter_rollouts(rows, np.full(5, ""), CONFIG, FRAME, GO2, recovery)
    assert paper.reasons == ("distance", "distance", "leg_overlap", "distance", "distance")


def test_where_nothing_is_settled_all_rows_are_judged():
    config = replace(CONFIG, diversity=DiversitySettings("cloning"))
    rows = perfect(2) | {"push": np.zeros((2, ROWS, 3), np.float32)}
    too_far(rows, 1)
    assert filter_rollouts(rows, np.full(2, ""), config, FRAME, GO2, np.ones(2, bool)).reasons == ("", "distance")
