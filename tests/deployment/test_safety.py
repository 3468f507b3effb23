"""The state machine that damps a robot, without clock, network or robot."""

from dataclasses import replace

import numpy as np
import pytest

from kine2go_warp.deployment.metadata import JointRow
from kine2go_warp.deployment.robot import RobotState, RootEstimate
from kine2go_warp.deployment.safety import Phase, SafetyLimits, Schedule, Supervisor, tilt_of
from kine2go_warp.errors import Kine2GoError

JOINTS = tuple(JointRow(f"joint_{index}", index, index, 0.0, -1.0, 1.0, 20.0) for index in range(12))
LIMITS = SafetyLimits(max_tilt=0.5, max_age=0.05, joint_margin=0.1, torque_share=0.8, torque_time=0.06)
SCHEDULE = Schedule(stand_seconds=1.0, seconds=2.0, start_after=0.5, halt_seconds=0.5)
TURN = 0.004


def state_at(now, **changes):
    """A level robot at rest, whose clock began 100 s before ours and whose messages take 2 ms."""
    state = RobotState(now, now + 100.0 - 0.002, np.array([1.0, 0, 0, 0]), np.zeros(3), *np.zeros((3, 12)))
    return replace(state, **changes)


def estimate_at(now):
    return RootEstimate(now, np.zeros(3), np.zeros(3))


def tilted(angle):
    return np.array([np.cos(0.5 * angle), 0.6 * np.sin(0.5 * angle), 0.8 * np.sin(0.5 * angle), 0.0])


def advance(supervisor, until, begin=0.0, make=state_at, **more):
    """Turn by turn to an instant; returns the instant and the phases that were entered, each with its instant."""
    entered, now = [], begin
    while now < until:
        before = supervisor.phase
        supervisor.update(now, make(now), estimate_at(now), **more)
        if supervisor.phase is not before:
            entered.append((supervisor.phase, round(now, 2)))
        now += TURN
    return now, entered


def tracking(**more):
    supervisor = Supervisor(JOINTS, LIMITS, replace(SCHEDULE, **more))
    now, _ = advance(supervisor, 1.6)
    assert supervisor.phase is Phase.TRACKING
    return supervisor, now


def test_a_run_without_trouble_goes_through_all_phases_in_time():
    supervisor = Supervisor(JOINTS, LIMITS, SCHEDULE)
    _, entered = advance(supervisor, 5.0)
    assert [phase for phase, _ in entered] == [Phase.READY, Phase.TRACKING, Phase.HALTING, Phase.DAMPED]
    np.testing.assert_allclose([when for _, when in entered], (1.0, 1.5, 3.5, 4.0), atol=3 * TURN)
    assert supervisor.completed
    assert supervisor.reason == "tracked for 2 s"


def test_it_waits_for_the_operator_however_long_and_starts_on_the_word_alone():
    supervisor = Supervisor(JOINTS, LIMITS, replace(SCHEDULE, start_after=None))
    now, _ = advance(supervisor, 12.0)
    assert supervisor.phase is Phase.READY
    assert supervisor.update(now, state_at(now), None, start=True) is Phase.TRACKING


def test_the_word_to_start_counts_only_once_the_robot_stands():
    supervisor = Supervisor(JOINTS, LIMITS, replace(SCHEDULE, start_after=None))
    advance(supervisor, 0.9, start=True)
    assert supervisor.phase is Phase.STANDING_UP


BAD = {
    "tilted": ({"root_orientation": tilted(0.6)}, "tilted by 0.60 rad"),
    "upside down": ({"root_orientation": tilted(np.pi)}, "tilted by 3.14 rad"),
    "joint too low": ({"joint_position": np.r_[np.zeros(7), -1.15, np.zeros(4)]}, "joint_7 is at -1.15 rad"),
    "joint too high": ({"joint_position": np.r_[1.15, np.zeros(11)]}, "joint_0 is at 1.15 rad"),
    "NaN": ({"joint_velocity": np.r_[np.nan, np.zeros(11)]}, "not finite"),
}


@pytest.mark.parametrize("phase_at", [0.3, 1.2, 1.7, 3.7], ids=["standing up", "ready", "tracking", "halting"])
@pytest.mark.parametrize("name", BAD)
def test_a_limit_damps_at_once_in_every_phase_and_for_good(name, phase_at):
    changes, message = BAD[name]
    supervisor = Supervisor(JOINTS, LIMITS, SCHEDULE)
    now, _ = advance(supervisor, phase_at)
    assert supervisor.update(now, state_at(now, **changes), None) is Phase.DAMPED
    assert message in supervisor.reason
    assert "\n" not in supervisor.reason
    reason = supervisor.reason
    advance(supervisor, now + 10.0, now, start=True)
    assert (supervisor.phase, supervisor.reason, supervisor.completed) == (Phase.DAMPED, reason, False)


@pytest.mark.parametrize("changes", [{"root_orientation": tilted(0.4)}, {"joint_position": np.full(12, 1.05)}])
def test_within_the_limits_nothing_happens(changes):
    supervisor = Supervisor(JOINTS, LIMITS, SCHEDULE)
    advance(supervisor, 1.6, make=lambda now: state_at(now, **changes))
    assert supervisor.phase is Phase.TRACKING


def test_the_operator_stops_it():
    supervisor, now = tracking()
    assert supervisor.update(now, state_at(now), None, stop="stopped by the operator") is Phase.DAMPED
    assert supervisor.reason == "stopped by the operator"


def damped_after(supervisor, now, make, limit=0.5, estimate=estimate_at):
    """Time from an instant until the robot is damped."""
    begin = now
    while supervisor.update(now, make(now), estimate(now)) is not Phase.DAMPED:
        now += TURN
        assert now < begin + limit, "the robot was not damped"
    return now - begin


def test_states_that_no_longer_come_damp_within_the_limit():
    supervisor, now = tracking()
    last = state_at(now)
    assert damped_after(supervisor, now, lambda _: last) < LIMITS.max_age + 2 * TURN
    assert "newest state of the robot is" in supervisor.reason


def test_states_that_come_as_often_but_late_damp_too():
    """Each arrives just now, and was sent 80 ms ago: only the robot's own clock shows it."""
    supervisor, now = tracking()
    supervisor.update(now, state_at(now, sent=now + 100.0 - 0.080), None)
    assert supervisor.phase is Phase.DAMPED
    assert "is 78 ms old" in supervisor.reason


def test_a_delay_that_grows_slowly_is_seen_as_well():
    supervisor, now = tracking(seconds=60.0)
    begin = now
    took = damped_after(
        supervisor, now, lambda now: state_at(now, sent=now + 100.0 - 0.002 - 0.01 * (now - begin)), limit=20.0
    )
    assert took == pytest.approx(5.0, abs=0.1)


def test_a_clock_of_the_robot_that_stands_still_damps():
    supervisor = Supervisor(JOINTS, LIMITS, SCHEDULE)
    assert damped_after(supervisor, 0.0, lambda now: state_at(now, sent=0.0)) < 0.1


def test_a_control_loop_that_stood_still_damps():
    supervisor, now = tracking()
    supervisor.update(now + 0.2, state_at(now + 0.2), None)
    assert supervisor.phase is Phase.DAMPED
    assert "the control loop stood still for 20" in supervisor.reason


def test_an_overloaded_motor_is_borne_for_a_moment_only():
    def loaded(now):
        return state_at(now, joint_torque=np.r_[np.zeros(4), -17.0, np.zeros(7)])

    supervisor, now = tracking()
    now, _ = advance(supervisor, now + 0.05, now, loaded)
    now, _ = advance(supervisor, now + 0.05, now)
    assert supervisor.phase is Phase.TRACKING, "it had time to recover"
    assert damped_after(supervisor, now, loaded) == pytest.approx(LIMITS.torque_time, abs=2 * TURN)
    assert supervisor.reason == "joint_4 is overloaded with 17 N m"


def test_a_lost_estimate_damps_where_the_policy_needs_one():
    supervisor = Supervisor(JOINTS, LIMITS, SCHEDULE, needs_estimate=True)
    now, _ = advance(supervisor, 1.6)
    last = estimate_at(now)
    assert damped_after(supervisor, now, state_at, estimate=lambda _: last) < LIMITS.max_age + 2 * TURN
    assert "estimate of the base" in supervisor.reason
    for estimate in (None, RootEstimate(0.0, np.full(3, np.nan), np.zeros(3))):
        supervisor = Supervisor(JOINTS, LIMITS, SCHEDULE, needs_estimate=True)
        assert supervisor.update(0.0, state_at(0.0), estimate) is Phase.DAMPED


def test_without_need_no_estimate_is_missed():
    supervisor, now = tracking()
    supervisor.update(now, state_at(now), None)
    assert supervisor.phase is Phase.TRACKING


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.5, 3.0])
@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_the_tilt_does_not_depend_on_the_heading(angle, heading):
    from scipy.spatial.transform import Rotation

    turned = Rotation.from_euler("z", heading) * Rotation.from_quat(tilted(angle), scalar_first=True)
    state = state_at(0.0, root_orientation=2.0 * turned.as_quat(scalar_first=True))
    assert tilt_of(state) == pytest.approx(angle, abs=1e-7)


@pytest.mark.parametrize("wrong", [{"max_tilt": 0.0}, {"max_age": -1.0}, {"torque_time": np.nan}])
def test_limits_that_make_no_sense_are_refused(wrong):
    with pytest.raises(Kine2GoError, match=next(iter(wrong))):
        SafetyLimits(**wrong)
