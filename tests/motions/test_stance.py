import numpy as np
import pytest

from kine2go_warp.motions.body import height_bounds, leg_length_limits, lowest_body_point, smooth_root, smooth_shift
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.motions.stance import Interval, Reach, detect_stance, hold_feet, intervals
from kine2go_warp.robots import GO2
from kine2go_warp.robots.kinematics import foot_positions

CONFIG = RetargetConfig()
FRAME = 1.0 / 60.0


def stepping(num_frames=120, noise=0.0, rng=None):
    """Feet that stand for 18 frames and swing 0.3 m in 12, and a base that goes along."""
    frames = np.arange(num_frames)
    share = np.clip((frames % 30 - 17) / 13.0, 0.0, 1.0)
    x = 0.3 * (frames // 30 + share)
    z = 0.06 * np.sin(np.pi * share)
    feet = np.zeros((num_frames, 4, 3))
    feet[..., 0], feet[..., 2] = x[:, None], z[:, None]
    if rng is not None:
        feet += rng.normal(0.0, noise, feet.shape)
    root = np.stack([0.3 * frames / 30.0, np.zeros(num_frames), np.full(num_frames, 0.3)], axis=1)
    return feet, root, share == 0.0


def test_intervals_are_the_runs_of_true():
    assert intervals(np.array([1, 1, 0, 1, 0, 0, 1], dtype=bool)) == [Interval(0, 1), Interval(3, 3), Interval(6, 6)]
    assert intervals(np.zeros(3, dtype=bool)) == []


def test_stance_is_found_and_noise_does_not_toggle_it(rng):
    feet, _, truth = stepping()
    found = detect_stance(feet, FRAME, CONFIG)
    assert np.mean(found == truth[:, None]) > 0.85
    noisy, *_ = stepping(noise=5e-4, rng=rng)
    for foot in range(4):
        runs = intervals(detect_stance(noisy, FRAME, CONFIG)[:, foot])
        assert len(runs) == 4, "one stance a stride"


def test_a_short_touch_is_no_stance_and_a_short_lift_no_swing():
    feet, _, _ = stepping()
    feet[24, 0, 2] = 0.0
    feet[8, 1, 2] = 0.1
    assert len(intervals(detect_stance(feet, FRAME, CONFIG)[:, 0])) == 4
    assert len(intervals(detect_stance(feet, FRAME, CONFIG)[:, 1])) == 4


NO_ROLL = np.zeros((120, 4, 2))


def far_reach(root, farthest=0.6):
    """Legs that reach everything, from hips above the feet of ``stepping``."""
    return Reach(np.repeat(root[:, None] + [0.15, 0.0, 0.0], 4, axis=1), farthest, GO2.foot_radius)


def test_held_feet_stand_still_swing_clear_and_never_sink(rng):
    feet, root, _ = stepping(noise=1e-3, rng=rng)
    feet[..., 0] += 0.02 * np.sin(np.arange(120) / 5.0)[:, None]
    stance = detect_stance(feet, FRAME, CONFIG)
    held, kept, _ = hold_feet(feet, stance, NO_ROLL, far_reach(root), CONFIG)
    np.testing.assert_array_equal(kept, stance)
    for foot in range(4):
        for run in intervals(stance[:, foot]):
            np.testing.assert_array_equal(np.ptp(held[run.first : run.last + 1, foot], axis=0), 0.0)
        for run in intervals(~stance[:, foot]):
            if run.first > 0 and run.last < 119:
                assert held[run.first : run.last + 1, foot, 2].max() >= 0.9 * CONFIG.swing_clearance
    assert held[..., 2].min() >= 0.0
    # Where nothing had to be changed, little is: corrections are those of the footholds.
    assert np.abs(held[..., :2] - feet[..., :2]).max() < 0.08


def test_a_foot_that_never_stands_is_left_alone():
    feet, root, _ = stepping()
    feet[:, 2, 2] += 0.2 + 0.05 * np.sin(np.arange(120))
    stance = detect_stance(feet, FRAME, CONFIG)
    assert not stance[:, 2].any()
    held, *_ = hold_feet(feet, stance, NO_ROLL, far_reach(root), CONFIG)
    np.testing.assert_array_equal(held[:, 2], feet[:, 2])


@pytest.mark.parametrize(("rate", "size"), [(25.0, 1.0), (60.0, 0.5), (60.0, 2.0), (120.0, 1.0), (240.0, 0.25)])
def test_stance_is_found_at_any_rate_and_in_any_size(rate, size):
    time = np.arange(round(2.5 * rate)) / rate
    share = np.clip((np.mod(time, 0.5) - 0.3) / 0.2, 0.0, 1.0)
    feet = np.zeros((len(time), 4, 3))
    feet[..., 0] = (0.3 * size * (np.floor(time / 0.5) + share))[:, None]
    feet[..., 2] = (0.06 * size * np.sin(np.pi * share))[:, None]
    found = detect_stance(feet, 1.0 / rate, CONFIG)
    np.testing.assert_allclose(found.mean(axis=0), 0.6, atol=max(0.05, 2.0 / rate))


def test_a_swing_keeps_its_height_on_a_floor_that_rises():
    """What lift-off and touch-down add to the height is taken off at the ends of a swing, not in its middle."""
    feet, root, truth = stepping()
    feet[..., 2] += 0.02 * np.arange(120)[:, None] / 120
    held, *_ = hold_feet(feet, np.repeat(truth[:, None], 4, axis=1), NO_ROLL, far_reach(root), CONFIG)
    for run in intervals(~truth):
        if run.last < 119:
            assert held[run.frames, 0, 2].max() == pytest.approx(0.06, rel=0.04)


def test_standing_feet_roll_by_what_their_shanks_turn():
    feet, root, truth = stepping()
    stance = np.repeat(truth[:, None], 4, axis=1)
    rolling = 0.02 * np.stack([np.sin(np.arange(120) / 9.0), np.cos(np.arange(120) / 7.0)], axis=1)
    held, *_ = hold_feet(feet, stance, np.repeat(rolling[:, None], 4, axis=1), far_reach(root), CONFIG)
    both = truth[1:] & truth[:-1]
    np.testing.assert_allclose(np.diff(held[:, 1, :2], axis=0)[both], np.diff(rolling, axis=0)[both], atol=1e-12)


def test_footholds_out_of_reach_are_moved_and_what_is_left_is_released():
    feet, root, truth = stepping()
    stance = np.repeat(truth[:, None], 4, axis=1)
    reach = Reach(np.repeat(root[:, None], 4, axis=1), 0.3, GO2.foot_radius)
    held, kept, moved = hold_feet(feet, stance, NO_ROLL, reach, CONFIG)
    assert moved.max() > 0.03
    apart = np.linalg.norm(held[:, 0, :2] - root[:, :2], axis=1)
    lack = apart - reach.radius(0, held[:, 0, 2])
    assert lack[kept[:, 0]].max() < 5e-3
    assert np.all(stance | ~kept), "no foot stands that did not"
    assert kept.mean() > 0.7 * stance.mean()
    far = np.linalg.norm(feet[:, 0, :2] - root[:, :2], axis=1) - reach.radius(0, feet[:, 0, 2])
    assert far[truth].max() > 0.05, "without it, feet would be out of reach"


def test_height_bounds_are_where_the_knee_reaches_its_margin():
    """Independent of the closed form: bend the knee to its margin, and the base is at the bound."""
    orientation = np.array([[1.0, 0.0, 0.0, 0.0]])
    for side, knee in ((1, GO2.joint_upper[2] - 0.06), (0, GO2.joint_lower[2] + 0.06)):
        pitch = -0.5 * knee
        joints = np.array([0.0, pitch, knee] * 4)
        feet = foot_positions(GO2, joints)
        position = np.array([[0.0, 0.0, 0.0]])
        bound = height_bounds(GO2, position, orientation, feet[None], 0.06)[0, side]
        assert bound == pytest.approx(0.0, abs=1e-9)
    shortest, longest = leg_length_limits(GO2, 0.06)
    assert shortest < 0.12
    assert longest > 0.38


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_smoothed_shift_never_falls_short_of_the_need(rng, sign):
    needed = sign * np.maximum(rng.normal(-1.0, 1.0, 200), 0.0)
    shift = smooth_shift(needed, 5)
    assert np.all(sign * (shift - needed) >= -1e-12)
    assert np.abs(np.diff(shift)).max() < np.abs(np.diff(needed)).max()


def test_smoothing_keeps_a_steady_motion_and_unit_quaternions(rng):
    position = np.linspace(0.0, 1.0, 100)[:, None] * np.array([1.0, 0.5, 0.0])
    orientation = np.tile([1.0, 0.0, 0.0, 0.0], (100, 1)) + rng.normal(0.0, 0.01, (100, 4))
    smooth, turned = smooth_root(position, orientation, 2.0)
    np.testing.assert_allclose(smooth[10:-10], position[10:-10], atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(turned, axis=1), 1.0)


def test_the_lowest_point_of_the_body():
    stand = np.array([GO2.default_joint_position])
    upright = np.array([[1.0, 0.0, 0.0, 0.0]])
    high = lowest_body_point(GO2, np.array([[0.0, 0.0, 0.5]]), upright, stand)
    low = lowest_body_point(GO2, np.array([[0.0, 0.0, 0.057]]), upright, stand)
    assert low[0] < 0.0 < high[0], "the knees hang lower than the belly"
    flat = np.array([[0.0, 1.57, -2.7] * 4])
    assert lowest_body_point(GO2, np.array([[0.0, 0.0, 0.057]]), upright, flat)[0] <= 1e-9
