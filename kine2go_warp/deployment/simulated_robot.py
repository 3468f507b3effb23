"""A robot in plain MuJoCo that speaks the low-level interface, to try ``kine2go deploy`` on: a process of its own.

It shares no code with the controller but the messages, and it measures by itself how well the robot tracked.
"""

import argparse
import json
import select
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.deployment.dds import (
    COMMAND_TOPIC,
    ESTIMATE_TOPIC,
    STATE_TOPIC,
    LowCmd,
    LowState,
    SportModeState,
    Wire,
    blank,
    checksum,
    is_intact,
    newest,
)
from kine2go_warp.deployment.robot import realtime
from kine2go_warp.env.config import EnvConfig, MotorConfig
from kine2go_warp.env.mujoco_engine import FIRST_DOF, MujocoRobot
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.robots import RobotSpec

LYING_JOINTS, LYING_HEIGHT = (0.0, 1.36, -2.65), 0.1
"""Joint positions of each leg of a robot that lies [rad], as in the SDK's examples, and height of its base [m]."""
PHYSICS = EnvConfig(motor=MotorConfig(friction=1.0))
"""Rates, contacts and solver of the environment, and the joint friction that was measured on a robot."""
WATCHDOG = 0.05
"""Time without an intact command after which the motors only damp, for good [s]."""
WATCHDOG_DAMPING = 3.0
"""[N m s/rad]"""


@dataclass(frozen=True)
class Tracking:
    """How well the simulated robot tracked, measured by the simulator."""

    seconds: float
    """For how long [s]."""
    joint_rmse: float
    """Joint positions against the clip, played from the instant at which the controller says it began [rad]."""
    distance: float
    """How far the base moved from where it began, over the ground [m]."""
    reference_distance: float
    """The same of the clip [m]."""
    max_tilt: float
    """Largest angle between the base's up axis and the vertical [rad]."""


class SimulatedRobot:
    """The robot behind the interface: motors that obey commands, and sensors. Motors are in the SDK's order."""

    def __init__(self, spec: RobotSpec, config: EnvConfig) -> None:
        """Let the robot lie on the ground."""
        self.spec, self.dt = spec, config.substep_duration
        self.robot = MujocoRobot(config, spec)
        self.motors = np.array([spec.sdk_motor_order.index(name) for name in spec.joint_names])
        """Number of each joint's motor."""
        joint_q = np.zeros(19)
        joint_q[2], joint_q[6], joint_q[7:] = LYING_HEIGHT, 1.0, LYING_JOINTS * 4
        self.robot.set_state(joint_q, np.zeros(18))
        self._born = time.monotonic()
        self._gains = np.zeros((5, 12))
        """Rows tau, kp, q, kd, dq."""
        self._state, self._estimate = blank(LowState), blank(SportModeState)

    def obey(self, command: Any) -> None:
        """Take the commands of the motors from a ``LowCmd``."""
        motors = [command.motor_cmd[number] for number in self.motors]
        self._gains = np.array([(one.tau, one.kp, one.q, one.kd, one.dq) for one in motors]).T

    def damp(self) -> None:
        """Let the motors do nothing but damp."""
        self._gains = np.zeros((5, 12))
        self._gains[3] = WATCHDOG_DAMPING

    @property
    def is_damped(self) -> bool:
        """Whether the motors do nothing but damp."""
        tau, kp, _, kd, dq = self._gains
        return bool(not tau.any() and not kp.any() and not dq.any() and (kd > 0.0).all())

    def advance(self) -> None:
        """Simulate one physics step."""
        data = self.robot.data
        tau, kp, q, kd, dq = self._gains
        self.robot.drive(tau + kp * (q - data.qpos[7:]) + kd * (dq - data.qvel[FIRST_DOF:]))

    def state(self) -> Any:
        """Return what the sensors measure, as a ``LowState`` with its checksum."""
        data, state = self.robot.data, self._state
        state.tick = round(1e3 * (time.monotonic() - self._born))
        state.imu_state.quaternion = data.qpos[3:7].tolist()
        state.imu_state.gyroscope = data.qvel[3:6].tolist()
        values = zip(data.qpos[7:].tolist(), data.qvel[FIRST_DOF:].tolist(), self.robot.torque.tolist(), strict=True)
        for number, (position, velocity, torque) in zip(self.motors, values, strict=True):
            motor = state.motor_state[number]
            motor.q, motor.dq, motor.tau_est = position, velocity, torque
        state.crc = checksum(state)
        return state

    def estimate(self) -> Any:
        """Return where the base is, exactly, as a ``SportModeState``."""
        data, estimate = self.robot.data, self._estimate
        estimate.position, estimate.velocity = data.qpos[:3].tolist(), data.qvel[:3].tolist()
        return estimate


class Server:
    """Lets a simulated robot live in real time on the wire, and keeps a record of every step."""

    def __init__(self, robot: SimulatedRobot, network: str, domain: int, with_estimate: bool) -> None:
        """Connect the robot.

        Args:
            robot: The robot.
            network: Name of the network interface.
            domain: Number of the DDS domain.
            with_estimate: Publish where the base is.
        """
        wire = self._wire = Wire(network, domain)
        self.robot = robot
        self._commands = wire.reader(COMMAND_TOPIC, LowCmd)
        self._states = wire.writer(STATE_TOPIC, LowState)
        self._estimates = wire.writer(ESTIMATE_TOPIC, SportModeState) if with_estimate else None
        self.rejected = 0
        """Commands with a wrong checksum."""
        self._obeyed, self._tripped = np.nan, False
        self.rows: list[NDArray[np.float64]] = []
        """Time [s], whether the motors only damp, base position [m] and orientation (w, x, y, z), joints [rad]."""

    def step(self) -> None:
        """Live for one physics step."""
        now = time.monotonic()
        command = self.receive()
        if command is not None and not self._tripped:
            self.robot.obey(command)
            self._obeyed = now
        if now - self._obeyed > WATCHDOG:
            self._tripped = True
            self.robot.damp()
        self.robot.advance()
        self.publish()
        data = self.robot.robot.data
        self.rows.append(np.array([now, self.robot.is_damped, *data.qpos]))

    def receive(self) -> Any:
        """Return the newest intact command, none if none has come since the last call."""
        command = newest(self._commands)
        if command is not None and not self.intact(command):
            self.rejected += 1
            return None
        return command

    def intact(self, command: Any) -> bool:
        """Return whether a command may be obeyed."""
        return is_intact(command)

    def publish(self) -> None:
        """Send the state, and the estimate."""
        self._states.write(self.robot.state())
        if self._estimates is not None:
            self._estimates.write(self.robot.estimate())

    def run(self) -> str:
        """Live until a line comes on standard input or it is closed; return the line."""
        due = time.monotonic()
        while not select.select([sys.stdin], [], [], 0.0)[0]:
            self.step()
            # Steps that came late are made up for, up to as much as the watchdog allows.
            due = max(due + self.robot.dt, time.monotonic() - 0.5 * WATCHDOG)
            time.sleep(max(0.0, due - time.monotonic()))
        return sys.stdin.readline()

    def tracking(self, clip: MotionClip, began: float, seconds: float) -> Tracking | None:
        """Return how well the robot tracked a clip from an instant on, none if it did not live to see it."""
        rows = np.array(self.rows)
        rows = rows[(rows[:, 0] >= began) & (rows[:, 0] <= began + seconds)] if len(rows) else rows
        if not len(rows):
            return None
        expected = played(clip, rows[:, 0] - began)
        root, (_, x, y, _) = rows[:, 2:5], rows[:, 5:9].T
        return Tracking(
            seconds=float(rows[-1, 0] - rows[0, 0]),
            joint_rmse=float(np.sqrt(np.mean((rows[:, 9:] - expected) ** 2))),
            distance=float(np.linalg.norm(root[-1, :2] - root[0, :2])),
            reference_distance=travelled(clip, float(rows[-1, 0] - began)),
            max_tilt=float(np.arccos(np.min(1.0 - 2.0 * (x * x + y * y)))),
        )


def played(clip: MotionClip, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the joint positions of a clip at some times from its beginning [rad], shape [num_times, 12]."""
    frame = np.minimum(times / clip.frame_duration, np.inf if clip.cycle else clip.span)
    whole = np.floor(frame).astype(int)
    share = (frame - whole)[:, None]
    one, other = (
        clip.joint_position[index % clip.num_frames if clip.cycle else np.minimum(index, clip.span)]
        for index in (whole, whole + 1)
    )
    return one + share * (other - one)


def travelled(clip: MotionClip, seconds: float) -> float:
    """Return how far a clip's root is from where it began, over the ground, to the nearest frame [m]."""
    frame = round(seconds / clip.frame_duration)
    if not clip.cycle:
        return float(np.linalg.norm(clip.root_position[min(frame, clip.span), :2] - clip.root_position[0, :2]))
    cycles, rest = divmod(frame, clip.num_frames)
    turn = np.exp(1j * clip.cycle.yaw)
    origin = sum((turn**number for number in range(cycles)), 0.0j) * complex(clip.cycle.x, clip.cycle.y)
    end, start = (complex(*clip.root_position[index, :2]) for index in (rest, 0))
    return abs(origin + turn**cycles * end - start)


def main(arguments: Sequence[str] | None = None, server: type[Server] = Server) -> None:
    """Run a simulated robot until standard input is closed, or says "BEGAN SECONDS": then print how well it tracked.

    Args:
        arguments: Of the command line; by default those of this process.
        server: How the robot lives.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clip", type=Path, help="clip of the robot, from a deploy bundle")
    parser.add_argument("--network", default="lo", help="network interface")
    parser.add_argument("--domain", type=int, default=0, help="DDS domain")
    parser.add_argument("--estimate", action="store_true", help="publish where the base is, as SportModeState")
    parser.add_argument("--rows", type=Path, help="write time, damped, base and joints of every step to this .npy file")
    options = parser.parse_args(arguments)
    clip = MotionClip.load(options.clip)
    life = server(SimulatedRobot(clip.spec, PHYSICS), options.network, options.domain, options.estimate)
    print("ready", flush=True)
    try:
        with realtime():
            line = life.run()
    except KeyboardInterrupt:
        line = ""
    if options.rows is not None:
        np.save(options.rows, np.array(life.rows))
    if line.strip():
        found = life.tracking(clip, *map(float, line.split()))
        print(json.dumps(found and asdict(found)), flush=True)


if __name__ == "__main__":
    main()
