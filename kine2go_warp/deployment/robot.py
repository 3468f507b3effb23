"""What passes between a controller and a robot, whatever carries it. Joints are in the policy's order."""

import contextlib
import os
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class RobotState:
    """What a robot measures at one instant."""

    arrival: float
    """When it was received [s], by the clock of the receiver."""
    sent: float
    """When it was measured [s], by the clock of the robot, which begins anywhere."""
    root_orientation: NDArray[Any]
    """Base link (w, x, y, z), shape [4]; the heading is counted from anywhere."""
    angular_velocity_b: NDArray[Any]
    """Base frame [rad/s], shape [3]."""
    joint_position: NDArray[Any]
    """[rad], shape [12]."""
    joint_velocity: NDArray[Any]
    """[rad/s], shape [12]."""
    joint_torque: NDArray[Any]
    """[N m], shape [12]."""


@dataclass(frozen=True)
class RootEstimate:
    """Where an estimator believes the base to be."""

    arrival: float
    """When it was received [s], by the clock of the receiver."""
    position: NDArray[Any]
    """Base link origin, world frame [m], shape [3]; z is 0 on the ground."""
    velocity: NDArray[Any]
    """World frame [m/s], shape [3]."""


@dataclass(frozen=True)
class MotorCommand:
    """Torque = stiffness * (position - joint position) - damping * joint velocity."""

    position: NDArray[Any]
    """[rad], shape [12]."""
    stiffness: float
    """[N m/rad]; 0 only damps."""
    damping: float
    """[N m s/rad]"""

    @classmethod
    def damped(cls, damping: float) -> "MotorCommand":
        """Return the command that lets a robot sink to the ground."""
        return cls(np.zeros(12), 0.0, damping)


class RobotLink(Protocol):
    """The connection to a robot."""

    def state(self) -> RobotState | None:
        """Return the newest state, none before the first."""
        ...

    def estimate(self) -> RootEstimate | None:
        """Return the newest estimate of the root, none before the first or without an estimator."""
        ...

    def send(self, command: MotorCommand) -> None:
        """Send a command; it holds until the next one."""
        ...


REALTIME_PRIORITY = 10
"""Above all ordinary processes, below the kernel's own."""


@contextlib.contextmanager
def realtime() -> Iterator[bool]:
    """Run the block ahead of ordinary processes; whether this process may is what it yields."""
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(REALTIME_PRIORITY))
    except PermissionError:
        yield False
        return
    try:
        yield True
    finally:
        os.sched_setscheduler(0, policy, parameters)
