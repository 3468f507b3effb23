"""When a robot may stand, track, and must be damped: a state machine without clock, network or robot of its own."""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from kine2go_warp.deployment.metadata import JointRow
from kine2go_warp.deployment.robot import RobotState, RootEstimate
from kine2go_warp.settings import check_ranges


class Phase(Enum):
    """What the robot is doing."""

    STANDING_UP = "the robot stands up"
    READY = "the robot stands and waits"
    TRACKING = "the robot tracks the clip"
    HALTING = "the robot comes to a stand"
    DAMPED = "the robot is damped"
    """Never left."""


@dataclass(frozen=True)
class SafetyLimits:
    """What damps the robot."""

    max_tilt: float = 1.0
    """Angle between the base's up axis and the vertical [rad]."""
    max_age: float = 0.05
    """Age of the newest state or estimate, or time between two turns of the control loop [s]."""
    joint_margin: float = 0.1
    """How far a joint may be beyond its limit [rad]."""
    torque_share: float = 0.84
    """Share of a joint's torque limit above which its motor is overloaded; a Go2's drives with at most 0.85 of it."""
    torque_time: float = 0.08
    """How long a motor may be overloaded [s]."""

    def __post_init__(self) -> None:
        check_ranges(self, max_tilt=(0.01, np.pi), max_age=(1e-3, 10), joint_margin=(0, np.pi))
        check_ranges(self, torque_share=(0.01, 10), torque_time=(0, 10))


@dataclass(frozen=True)
class Schedule:
    """How long each phase takes."""

    stand_seconds: float = 3.0
    """Time to stand up from wherever the joints are [s]."""
    seconds: float = 20.0
    """Time to track [s]."""
    start_after: float | None = None
    """Start to track after standing for this time [s]; by default on the operator's word alone."""
    halt_seconds: float = 1.0
    """Time to come to a stand after tracking [s]."""

    def __post_init__(self) -> None:
        check_ranges(self, stand_seconds=(0.1, 60), seconds=(0.1, 86400), start_after=(0, 3600), halt_seconds=(0.1, 60))


class Age:
    """How old what a sender sends is, compared with the fastest of its messages so far: gaps and delays both show.

    The clocks of sender and receiver need not agree, only run at the same rate.
    """

    def __init__(self) -> None:
        self._fastest = np.inf

    def of(self, state: RobotState, now: float) -> float:
        """Return the age of the newest state [s]."""
        self._fastest = min(self._fastest, state.arrival - state.sent)
        return now - state.sent - self._fastest


class Supervisor:
    """Decides the phase, turn by turn of the control loop; once damped, a robot stays damped."""

    def __init__(
        self,
        joints: tuple[JointRow, ...],
        limits: SafetyLimits,
        schedule: Schedule,
        needs_estimate: bool = False,
    ) -> None:
        """Begin before the first turn.

        Args:
            joints: The joint table.
            limits: What damps the robot.
            schedule: How long each phase takes.
            needs_estimate: Whether the policy needs an estimate of the root.
        """
        self.joints, self.limits, self.schedule, self.needs_estimate = joints, limits, schedule, needs_estimate
        self.phase, self.reason, self.completed = Phase.STANDING_UP, "", False
        """The phase; once damped why, and whether everything was tracked."""
        self.since = np.nan
        """When the phase began [s]."""
        self._lower = np.array([joint.lower for joint in joints]) - limits.joint_margin
        self._upper = np.array([joint.upper for joint in joints]) + limits.joint_margin
        self._overload = limits.torque_share * np.array([joint.torque_limit for joint in joints])
        self._overloaded_since = np.full(len(joints), np.nan)
        self._age, self._last = Age(), np.nan

    def update(
        self, now: float, state: RobotState, estimate: RootEstimate | None, start: bool = False, stop: str = ""
    ) -> Phase:
        """Return the phase of this turn.

        Args:
            now: Time by the receiver's clock [s].
            state: The newest state.
            estimate: The newest estimate, if any.
            start: Whether the operator wants the tracking to start.
            stop: Why the operator or the controller wants to stop, no text if not.
        """
        if np.isnan(self.since):
            self.since = self._last = now
        if self.phase is not Phase.DAMPED:
            reason = stop or self._violation(now, state, estimate)
            if reason:
                self._damp(reason, now)
            else:
                self._advance(now, start)
        self._last = now
        return self.phase

    def _advance(self, now: float, start: bool) -> None:
        """Go on to the next phase when it is time."""
        elapsed, schedule = now - self.since, self.schedule
        if self.phase is Phase.STANDING_UP and elapsed >= schedule.stand_seconds:
            self._enter(Phase.READY, now)
        elif self.phase is Phase.READY:
            if start or (schedule.start_after is not None and elapsed >= schedule.start_after):
                self._enter(Phase.TRACKING, now)
        elif self.phase is Phase.TRACKING and elapsed >= schedule.seconds:
            self._enter(Phase.HALTING, now)
        elif self.phase is Phase.HALTING and elapsed >= schedule.halt_seconds:
            self.completed = True
            self._damp(f"tracked for {schedule.seconds:g} s", now)

    def _enter(self, phase: Phase, now: float) -> None:
        """Begin a phase."""
        self.phase, self.since = phase, now

    def _damp(self, reason: str, now: float) -> None:
        """Damp for good."""
        self.reason = reason
        self._enter(Phase.DAMPED, now)

    def _violation(self, now: float, state: RobotState, estimate: RootEstimate | None) -> str:
        """Return which limit is exceeded, no text if none is."""
        limits = self.limits
        if (stood := now - self._last) > limits.max_age:
            return f"the control loop stood still for {1e3 * stood:.0f} ms"
        if (age := self._age.of(state, now)) > limits.max_age:
            return f"the newest state of the robot is {1e3 * age:.0f} ms old"
        values = (state.root_orientation, state.angular_velocity_b, state.joint_position, state.joint_velocity)
        if not all(np.isfinite(one).all() for one in (*values, state.joint_torque)):
            return "the robot reports a number that is not finite"
        if (tilt := tilt_of(state)) > limits.max_tilt:
            return f"the base is tilted by {tilt:.2f} rad"
        return self._joint_violation(now, state) or self._estimate_violation(now, estimate)

    def _joint_violation(self, now: float, state: RobotState) -> str:
        """Return which joint is beyond its limits."""
        position = state.joint_position
        beyond = np.flatnonzero((position < self._lower) | (position > self._upper))
        if beyond.size:
            return f"{self.joints[beyond[0]].name} is at {position[beyond[0]]:.2f} rad, beyond its limit"
        overloaded = np.abs(state.joint_torque) > self._overload
        since = np.where(np.isnan(self._overloaded_since), now, self._overloaded_since)
        self._overloaded_since = np.where(overloaded, since, np.nan)
        too_long = np.flatnonzero(now - self._overloaded_since > self.limits.torque_time)
        if too_long.size:
            torque = abs(state.joint_torque[too_long[0]])
            return f"{self.joints[too_long[0]].name} is overloaded with {torque:.0f} N m"
        return ""

    def _estimate_violation(self, now: float, estimate: RootEstimate | None) -> str:
        """Return what is wrong with the estimate of the root, if one is needed."""
        if not self.needs_estimate:
            return ""
        if estimate is None:
            return "no estimate of the base's position and velocity has come"
        if (age := now - estimate.arrival) > self.limits.max_age:
            return f"the newest estimate of the base is {1e3 * age:.0f} ms old"
        if not (np.isfinite(estimate.position).all() and np.isfinite(estimate.velocity).all()):
            return "the estimate of the base is not finite"
        return ""


def tilt_of(state: RobotState) -> float:
    """Return the angle between the base's up axis and the vertical [rad]."""
    _, x, y, _ = state.root_orientation / np.linalg.norm(state.root_orientation)
    return float(np.arccos(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0)))
