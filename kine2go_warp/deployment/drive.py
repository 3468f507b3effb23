"""The control loop: a robot stands up, tracks a clip with an exported policy, and is damped."""

import gc
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from kine2go_warp.deployment.controller import ExportedPolicy, PolicyController
from kine2go_warp.deployment.observer import Array, MeasuredState, estimated_rows
from kine2go_warp.deployment.robot import MotorCommand, RobotLink, RobotState, RootEstimate
from kine2go_warp.deployment.rotations import heading, to_matrix
from kine2go_warp.deployment.safety import Phase, SafetyLimits, Schedule, Supervisor
from kine2go_warp.errors import Kine2GoError, PolicyError
from kine2go_warp.settings import check_ranges

ROBOT = "go2"
"""The robot whose interface, damping and lying pose these are."""
CONNECT_SECONDS = 5.0
"""How long to wait for the first state [s]."""
HALT_BLEND = 0.2
"""Time within which the joints go to the standing pose after tracking [s]. A trotting robot whose legs take 1 s for it
stumbles over them: in simulation it fell in two of three trials, after 0.1 to 0.5 s in none of nine."""
UNKNOWN = np.full(3, np.nan)
"""Placeholder for a quantity without an estimate. An observation that used it would be NaN, which damps the robot."""


@dataclass(frozen=True)
class DriveConfig:
    """Settings of the control loop."""

    schedule: Schedule = field(default_factory=Schedule)
    limits: SafetyLimits = field(default_factory=SafetyLimits)
    stop_damping: float = 3.0
    """Damping of a robot that is damped [N m s/rad]."""
    damp_seconds: float = 2.0
    """How long it is commanded so before the program ends [s]."""
    robot_latency: float = 0.006
    """What message and motors take of the latency that the policy was trained with [s]; the rest is waited for."""

    def __post_init__(self) -> None:
        check_ranges(self, stop_damping=(0, 20), damp_seconds=(0.1, 60), robot_latency=(0, 1))


@dataclass(frozen=True)
class Outcome:
    """How a run ended."""

    reason: str
    """Why the robot was damped."""
    completed: bool
    """Whether everything was tracked."""
    began: float
    """When the tracking began [s], by this machine's monotonic clock; NaN if it did not."""
    tracked: float
    """For how long [s]."""
    joint_rmse: float
    """Of the joint positions that the robot reported, against the reference [rad]; NaN without any."""


def check_deployable(policy: ExportedPolicy, has_estimate: bool) -> None:
    """Check that a robot can do what a policy needs.

    Raises:
        PolicyError: it is of a robot with another interface, or it observes what is not measured.
    """
    metadata = policy.metadata
    if metadata.robot != ROBOT:
        raise PolicyError(f"{metadata.policy} is for the robot {metadata.robot}, and deploy drives a {ROBOT} alone")
    rows = estimated_rows(metadata.observation)
    if rows and not has_estimate:
        raise PolicyError(
            f"{metadata.policy} observes {' and '.join(rows)}, which the robot does not measure; train with --preset "
            "no_state_estimation, or give --estimate sport where something publishes an estimate"
        )


class Deployment:
    """Drives one robot once: ``run``, or ``turn`` by ``turn`` of the control loop."""

    def __init__(
        self,
        policy: ExportedPolicy,
        link: RobotLink,
        config: DriveConfig,
        clip: int = 0,
        on_phase: Callable[[Phase], None] = lambda _: None,
    ) -> None:
        """Prepare.

        Args:
            policy: What drives.
            link: The connection to the robot.
            config: Settings.
            clip: Which of the policy's clips to track.
            on_phase: Called when a phase begins.
        """
        metadata = self.metadata = policy.metadata
        self.link, self.config, self.on_phase = link, config, on_phase
        self.controller = PolicyController(policy, clip)
        needs_estimate = bool(estimated_rows(metadata.observation))
        self.supervisor = Supervisor(metadata.joints, config.limits, config.schedule, needs_estimate)
        self.rate = metadata.physics_rate
        """Turns of the loop in a second: the motors' targets move at this rate in training."""
        self._delay = max(0, round((metadata.latency - config.robot_latency) * self.rate))
        self._default = np.array(metadata.default_joint_position)
        self._from, self._target = self._default, self._default
        self._coming: deque[tuple[int, Array]] = deque()
        self._began, self._ended, self._trouble = np.nan, np.nan, ""
        self._squares: list[float] = []

    def run(
        self,
        should_start: Callable[[], bool] = lambda: False,
        should_stop: Callable[[], bool] = lambda: False,
    ) -> Outcome:
        """Drive the robot until it is damped.

        Args:
            should_start: Whether the operator wants the tracking to start.
            should_stop: Whether the operator wants to stop.

        Raises:
            Kine2GoError: no robot reports its state; nothing has been sent then.
        """
        self.connect(should_stop)
        # What there is now lives until the end; collecting it again and again would take milliseconds.
        gc.freeze()
        begin, turn = time.monotonic(), 0
        try:
            while not np.isfinite(self._ended) or time.monotonic() < self._ended + self.config.damp_seconds:
                self.turn(time.monotonic(), should_start(), "stopped by the operator" if should_stop() else "")
                turn = max(turn + 1, int((time.monotonic() - begin) * self.rate))
                time.sleep(max(0.0, begin + turn / self.rate - time.monotonic()))
        finally:
            self.link.send(MotorCommand.damped(self.config.stop_damping))
        return self.outcome

    def connect(self, should_stop: Callable[[], bool]) -> None:
        """Wait for the first state, and for the first estimate where one is needed.

        Raises:
            Kine2GoError: one does not come.
        """
        until = time.monotonic() + CONNECT_SECONDS
        needed: dict[str, Callable[[], Any]] = {"state": self.link.state}
        if self.supervisor.needs_estimate:
            needed["estimate of its base"] = self.link.estimate
        for name, read in needed.items():
            while read() is None:
                if should_stop() or time.monotonic() > until:
                    raise Kine2GoError(f"no robot sent a {name} within {CONNECT_SECONDS:g} s; nothing was sent to one")
                time.sleep(0.005)

    def turn(self, now: float, start: bool = False, stop: str = "") -> Phase:
        """Do one turn of the control loop: read, decide, command."""
        state, estimate = self.link.state(), self.link.estimate()
        if state is None:
            raise Kine2GoError("there is no state of a robot; connect first")
        before = self.supervisor.phase if np.isfinite(self.supervisor.since) else None
        phase = self.supervisor.update(now, state, estimate, start, stop or self._trouble)
        if phase is not before:
            self._begin(phase, now, state, estimate)
            self.on_phase(phase)
        if phase is Phase.TRACKING:
            self._track(now, state, estimate)
        elif phase in (Phase.STANDING_UP, Phase.HALTING):
            duration = self.config.schedule.stand_seconds if phase is Phase.STANDING_UP else HALT_BLEND
            share = np.clip((now - self.supervisor.since) / duration, 0.0, 1.0)
            # Begins and ends at rest.
            share = 0.5 - 0.5 * np.cos(np.pi * share)
            self._target = (1.0 - share) * self._from + share * self._default
        if phase is Phase.DAMPED:
            self.link.send(MotorCommand.damped(self.config.stop_damping))
        else:
            self.link.send(MotorCommand(self._target, self.metadata.stiffness, self.metadata.damping))
        return phase

    @property
    def outcome(self) -> Outcome:
        """How the run ended."""
        return Outcome(
            reason=self.supervisor.reason,
            completed=self.supervisor.completed,
            began=self._began,
            tracked=self.controller.step / self.metadata.control_rate if np.isfinite(self._began) else 0.0,
            joint_rmse=float(np.sqrt(np.mean(self._squares))) if self._squares else float("nan"),
        )

    def _begin(self, phase: Phase, now: float, state: RobotState, estimate: RootEstimate | None) -> None:
        """Do what the beginning of a phase needs."""
        if phase is Phase.STANDING_UP:
            self._from = state.joint_position
        elif phase is Phase.TRACKING:
            self._begin_episode(now, state, estimate)
        elif phase is Phase.HALTING:
            self._from = self._target
        elif phase is Phase.DAMPED:
            self._ended = now

    def _begin_episode(self, now: float, state: RobotState, estimate: RootEstimate | None) -> None:
        """Lay the beginning of the clip where the robot stands, and along its heading."""
        self._began = now
        ground = (0.0, 0.0) if estimate is None else (float(estimate.position[0]), float(estimate.position[1]))
        self.controller.begin(0.0, ground, 0.0)
        of_clip = heading(self.controller.reference.root(0.0).rotation)
        self.controller.begin(0.0, ground, heading(to_matrix(state.root_orientation)) - of_clip)

    def _track(self, now: float, state: RobotState, estimate: RootEstimate | None) -> None:
        """Let the policy act where it is time for it, and hold its targets back as in training."""
        turn = int((now - self._began) * self.rate + 0.5)
        due = turn // self.metadata.substeps
        if due >= self.controller.step:
            # A turn that came too late skips steps, so that the reference keeps to the clock.
            self.controller.step = due
            reference = self.controller.reference.joint_position(due)
            target = self.controller.act(measured(state, estimate))
            if not np.isfinite(target).all():
                self._trouble = "the policy returns a number that is not finite"
                return
            self._squares.append(float(np.mean((state.joint_position - reference) ** 2)))
            self._coming.append((turn + self._delay, target))
        while self._coming and self._coming[0][0] <= turn:
            self._target = self._coming.popleft()[1]


def measured(state: RobotState, estimate: RootEstimate | None) -> MeasuredState:
    """Return the state that observations are computed from; position and velocity are NaN without an estimate."""
    return MeasuredState(
        root_position=UNKNOWN if estimate is None else estimate.position,
        root_orientation=state.root_orientation,
        root_linear_velocity=UNKNOWN if estimate is None else estimate.velocity,
        root_angular_velocity=to_matrix(state.root_orientation) @ state.angular_velocity_b,
        joint_position=state.joint_position,
        joint_velocity=state.joint_velocity,
    )
