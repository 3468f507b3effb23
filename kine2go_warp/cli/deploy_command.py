"""The command that drives a robot, real or simulated, with an exported policy."""

import contextlib
import json
import select
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from kine2go_warp.cli.texts import say
from kine2go_warp.deployment.safety import Phase, SafetyLimits
from kine2go_warp.errors import Kine2GoError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from kine2go_warp.deployment.controller import ExportedPolicy
    from kine2go_warp.deployment.drive import Outcome

SAFETY_STOP, INTERRUPTED = 1, 130
"""Exit statuses of a run that a limit or the operator ended."""

NO_PRIORITY = (
    "kine2go: no real-time priority, which takes root or CAP_SYS_NICE; other work on this machine may delay the "
    "control loop, which damps the robot"
)


@dataclass(frozen=True)
class Deploy:
    """Drive a Go2, real or simulated, with an exported policy through the low-level interface of Unitree's SDK.

    Example: kine2go deploy runs/policies/dog_trot/export --network lo --simulate

    The robot stands up, waits for Enter, tracks, comes to a stand and is damped; docs/deploy.md says what to do before.
    Exit status 1: a limit was exceeded, and the robot damped.
    """

    bundle: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="BUNDLE")]
    """Folder made by 'kine2go policy export'."""
    network: Annotated[str, tyro.conf.arg(metavar="INTERFACE")]
    """Network interface that the robot is at, such as eth0; lo for a simulated one."""
    simulate: bool = False
    """Start a simulated robot at that interface in a process of its own, and print how well it tracked."""
    clip: str = ""
    """Name of the clip to track; by default the bundle's first."""
    seconds: float = 20.0
    """Time to track [s]."""
    stand_seconds: float = 3.0
    """Time to stand up [s]."""
    start_after: float | None = None
    """Start to track by itself after standing for this time [s], instead of on Enter."""
    estimate: Literal["none", "sport"] = "none"
    """Where position and velocity of the base come from, if the policy observes them. sport: the robot's topic
    rt/sportmodestate."""
    robot_latency: float = 0.006
    """What messages and motors take of the latency that the policy was trained with [s]."""
    domain: int = 0
    """DDS domain; Unitree's robots are in 0."""
    limits: SafetyLimits = field(default_factory=SafetyLimits)

    def run(self) -> int:
        """Drive, and say how it ended."""
        from kine2go_warp.deployment.controller import ExportedPolicy
        from kine2go_warp.deployment.dds import UnitreeLink
        from kine2go_warp.deployment.drive import Deployment, DriveConfig, check_deployable
        from kine2go_warp.deployment.robot import realtime
        from kine2go_warp.deployment.safety import Schedule
        from kine2go_warp.interruption import StopRequest

        schedule = Schedule(self.stand_seconds, self.seconds, self.start_after)
        config = DriveConfig(schedule, self.limits, robot_latency=self.robot_latency)
        policy = ExportedPolicy.load(self.bundle)
        check_deployable(policy, self.estimate != "none")
        names = [clip.name for clip in policy.clips]
        if self.clip and self.clip not in names:
            raise Kine2GoError(f"{self.bundle}: no clip '{self.clip}'; there are: {', '.join(names)}")
        clip = names.index(self.clip) if self.clip else 0
        operator = Operator(names[clip], self.seconds, waits=self.start_after is None)
        with StopRequest("damping the robot; once more ends at once") as stop, self.simulated(policy, clip) as robot:
            link = UnitreeLink(self.network, self.domain, policy.metadata.sdk_index, self.estimate != "none")
            drive = Deployment(policy, link, config, clip, operator.on_phase)
            with realtime() as is_realtime:
                if not is_realtime:
                    say(NO_PRIORITY, error=True)
                outcome = drive.run(operator.wants_start, lambda: stop.requested or operator.is_gone)
            lost = f" ({link.damaged} states had a wrong checksum)" if link.damaged else ""
            say(f"damped: {outcome.reason}{lost}")
            if outcome.tracked:
                error = f"joint RMSE {outcome.joint_rmse:.4f} rad"
                say(f"{names[clip]}: tracked for {outcome.tracked:.1f} s; by the robot's states {error}")
                if robot is not None:
                    print_tracking(robot, outcome)
        if outcome.completed:
            return 0
        return INTERRUPTED if stop.requested else SAFETY_STOP

    @contextlib.contextmanager
    def simulated(self, policy: "ExportedPolicy", clip: int) -> "Iterator[subprocess.Popen[str] | None]":
        """Run a simulated robot, if one is wanted, while the block runs."""
        if not self.simulate:
            yield None
            return
        command = [sys.executable, "-m", "kine2go_warp.deployment.simulated_robot"]
        command += [str(self.bundle / policy.metadata.clips[clip].file), "--network", self.network]
        command += ["--domain", str(self.domain), *(["--estimate"] if self.estimate != "none" else [])]
        # A session of its own, so that Ctrl-C reaches the controller alone.
        with subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
        ) as robot:
            try:
                assert robot.stdout is not None
                if not robot.stdout.readline():
                    raise Kine2GoError("the simulated robot did not start")
                yield robot
            finally:
                robot.kill()


class Operator:
    """Who watches the robot: presses Enter, and reads what it does."""

    def __init__(self, clip: str, seconds: float, waits: bool) -> None:
        """Prepare; ``waits`` for whether Enter starts the tracking."""
        self.clip, self.seconds, self.waits = clip, seconds, waits
        self.is_gone = False
        """Whether standard input was closed while Enter was awaited."""
        self._is_asked = False

    def on_phase(self, phase: Phase) -> None:
        """Say what the robot does."""
        if phase is Phase.READY and self.waits:
            say(f"standing: press Enter to track {self.clip} for {self.seconds:g} s, Ctrl-C to damp")
            while self._has_input() and sys.stdin.readline():
                pass  # what was pressed before does not count
            self._is_asked = True
        elif phase is not Phase.DAMPED:
            say(phase.value)

    def wants_start(self) -> bool:
        """Return whether Enter was pressed since the robot stands."""
        if not self._is_asked or not self._has_input():
            return False
        if not sys.stdin.readline():
            self.is_gone, self._is_asked = True, False
        return self._is_asked

    @staticmethod
    def _has_input() -> bool:
        """Return whether reading standard input would not block."""
        return bool(select.select([sys.stdin], [], [], 0.0)[0])


def print_tracking(robot: "subprocess.Popen[str]", outcome: "Outcome") -> None:
    """Ask the simulated robot how well it tracked, and print it."""
    assert robot.stdin is not None
    assert robot.stdout is not None
    robot.stdin.write(f"{outcome.began} {outcome.tracked}\n")
    robot.stdin.flush()
    found = json.loads(robot.stdout.readline() or "null")
    if found is None:
        say("the simulated robot has ended and measured nothing")
        return
    say(
        f"by the simulator: joint RMSE {found['joint_rmse']:.4f} rad, {found['distance']:.2f} m away from the start "
        f"(the clip {found['reference_distance']:.2f} m), tilted by at most {found['max_tilt']:.2f} rad"
    )
