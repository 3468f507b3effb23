"""The low-level interface of Unitree's SDK over DDS: its messages, their checksum, and both ends of the wire.

The messages are declared from the facts of the SDK's public IDL (``unitree_go/msg/dds_``, BSD-3-Clause, as in
unitree_sdk2_python at 37116c5): names of types, names, order and types of fields. The SDK itself is not on PyPI.
"""

import socket
import struct
import time
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, dataclass_transform
from xml.sax.saxutils import quoteattr

import cyclonedds.idl.annotations as annotate
import numpy as np
from cyclonedds import idl
from cyclonedds.core import DDSException
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl.types import array, float32, int16, int32, uint8, uint16, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from kine2go_warp.deployment.robot import MotorCommand, RobotState, RootEstimate
from kine2go_warp.errors import Kine2GoError

COMMAND_TOPIC, STATE_TOPIC, ESTIMATE_TOPIC = "rt/lowcmd", "rt/lowstate", "rt/sportmodestate"
NUM_MOTORS = 20
"""Motors in a message; a quadruped has the first 12."""
HEAD, LOW_LEVEL, SERVO = (0xFE, 0xEF), 0xFF, 0x01
"""First bytes of a command, its level, and the mode of a motor that is driven."""
NO_POSITION, NO_VELOCITY = 2.146e9, 16000.0
"""What the SDK's examples send for motors that shall do nothing."""


@dataclass_transform()
def message(cls: type[Any]) -> Any:
    """Declare a message as the SDK does: final, its members numbered in their order."""
    return annotate.final(annotate.autoid("sequential")(dataclass(cls)))


@message
class BmsCmd(idl.IdlStruct, typename="unitree_go.msg.dds_.BmsCmd_"):
    """To the battery."""

    off: uint8
    reserve: array[uint8, 3]


@message
class MotorCmd(idl.IdlStruct, typename="unitree_go.msg.dds_.MotorCmd_"):
    """To one motor: torque = tau + kp * (q - position) + kd * (dq - velocity)."""

    mode: uint8
    q: float32
    dq: float32
    tau: float32
    kp: float32
    kd: float32
    reserve: array[uint32, 3]


@message
class LowCmd(idl.IdlStruct, typename="unitree_go.msg.dds_.LowCmd_"):
    """To the robot."""

    head: array[uint8, 2]
    level_flag: uint8
    frame_reserve: uint8
    sn: array[uint32, 2]
    version: array[uint32, 2]
    bandwidth: uint16
    motor_cmd: array[MotorCmd, NUM_MOTORS]
    bms_cmd: BmsCmd
    wireless_remote: array[uint8, 40]
    led: array[uint8, 12]
    fan: array[uint8, 2]
    gpio: uint8
    reserve: uint32
    crc: uint32


@message
class ImuState(idl.IdlStruct, typename="unitree_go.msg.dds_.IMUState_"):
    """Of the base: orientation (w, x, y, z), angular velocity [rad/s] and acceleration [m/s^2] in the base frame."""

    quaternion: array[float32, 4]
    gyroscope: array[float32, 3]
    accelerometer: array[float32, 3]
    rpy: array[float32, 3]
    temperature: uint8


@message
class MotorState(idl.IdlStruct, typename="unitree_go.msg.dds_.MotorState_"):
    """Of one motor [rad, rad/s, rad/s^2, N m]."""

    mode: uint8
    q: float32
    dq: float32
    ddq: float32
    tau_est: float32
    q_raw: float32
    dq_raw: float32
    ddq_raw: float32
    temperature: uint8
    lost: uint32
    reserve: array[uint32, 2]


@message
class BmsState(idl.IdlStruct, typename="unitree_go.msg.dds_.BmsState_"):
    """Of the battery."""

    version_high: uint8
    version_low: uint8
    status: uint8
    soc: uint8
    current: int32
    cycle: uint16
    bq_ntc: array[uint8, 2]
    mcu_ntc: array[uint8, 2]
    cell_vol: array[uint16, 15]


@message
class LowState(idl.IdlStruct, typename="unitree_go.msg.dds_.LowState_"):
    """Of the robot; ``tick`` counts milliseconds."""

    head: array[uint8, 2]
    level_flag: uint8
    frame_reserve: uint8
    sn: array[uint32, 2]
    version: array[uint32, 2]
    bandwidth: uint16
    imu_state: ImuState
    motor_state: array[MotorState, NUM_MOTORS]
    bms_state: BmsState
    foot_force: array[int16, 4]
    foot_force_est: array[int16, 4]
    tick: uint32
    wireless_remote: array[uint8, 40]
    bit_flag: uint8
    adc_reel: float32
    temperature_ntc1: uint8
    temperature_ntc2: uint8
    power_v: float32
    power_a: float32
    fan_frequency: array[uint16, 4]
    reserve: uint32
    crc: uint32


@message
class TimeSpec(idl.IdlStruct, typename="unitree_go.msg.dds_.TimeSpec_"):
    """An instant."""

    sec: int32
    nanosec: uint32


@message
class PathPoint(idl.IdlStruct, typename="unitree_go.msg.dds_.PathPoint_"):
    """A point of a planned path."""

    t_from_start: float32
    x: float32
    y: float32
    yaw: float32
    vx: float32
    vy: float32
    vyaw: float32


@message
class SportModeState(idl.IdlStruct, typename="unitree_go.msg.dds_.SportModeState_"):
    """The estimate of the robot's own walking service; position [m] and velocity [m/s] are taken as in the world."""

    stamp: TimeSpec
    error_code: uint32
    imu_state: ImuState
    mode: uint8
    progress: float32
    gait_type: uint8
    foot_raise_height: float32
    position: array[float32, 3]
    body_height: float32
    velocity: array[float32, 3]
    yaw_speed: float32
    range_obstacle: array[float32, 4]
    foot_force: array[int16, 4]
    foot_position_body: array[float32, 12]
    foot_speed_body: array[float32, 12]
    path_point: array[PathPoint, 10]


MOTOR_CMD, MOTOR_STATE, IMU_STATE = "B5f3I", "B7fB3I", "13fB0I"
PACKED = {
    LowCmd: f"4B4IH0I{MOTOR_CMD * NUM_MOTORS}59B0I2I",
    LowState: f"4B4IH0I{IMU_STATE}{MOTOR_STATE * NUM_MOTORS}4BiH4B15H0I8hI41BfBB2f4H2I",
}
"""The C structures over which checksums go, as formats of ``struct`` with native alignment."""
MIRRORED_BYTES = bytes(int(f"{value:08b}"[::-1], 2) for value in range(256))


def blank(kind: type[Any]) -> Any:
    """Return a message whose numbers are all zero."""
    return kind.deserialize(bytes(4096))


def numbers(part: Any) -> Iterator[float]:
    """Yield all numbers of a message in their order."""
    # Messages that were received have attributes besides their fields.
    fields = getattr(part, "__dataclass_fields__", None)
    for value in part if fields is None else (getattr(part, name) for name in fields):
        if isinstance(value, int | float):
            yield value
        else:
            yield from numbers(value)


def packed(sample: Any) -> bytes:
    """Return a ``LowCmd`` or ``LowState`` as the C structure of the SDK."""
    return struct.pack(PACKED[type(sample)], *numbers(sample))


def checksum(sample: Any) -> int:
    """Return the SDK's checksum of a ``LowCmd`` or ``LowState``: CRC-32 with polynomial 0x04C11DB7 from the highest bit
    on, begun with all ones, over the 32-bit words of the structure but the last, which holds the checksum.
    """  # noqa: D205
    words = np.frombuffer(packed(sample), "<u4")[:-1].byteswap()
    # zlib begins with the lowest bit instead, and inverts the result.
    mirrored = zlib.crc32(words.tobytes().translate(MIRRORED_BYTES)) ^ 0xFFFFFFFF
    return int(f"{mirrored:032b}"[::-1], 2)


class Wire:
    """A DDS domain on one network interface, with some topics to write and some to read."""

    def __init__(self, network: str, domain: int) -> None:
        """Join the domain.

        Args:
            network: Name of the interface, such as ``eth0``.
            domain: Number of the domain; Unitree's robots are in 0.

        Raises:
            Kine2GoError: there is no such interface, or DDS cannot use it.
        """
        known = [name for _, name in socket.if_nameindex()]
        if network not in known:
            raise Kine2GoError(f"no network interface '{network}' on this machine; there are: {', '.join(known)}")
        interfaces = f"<Interfaces><NetworkInterface name={quoteattr(network)}/></Interfaces>"
        config = f'<CycloneDDS><Domain Id="any"><General>{interfaces}</General></Domain></CycloneDDS>'
        try:
            self._domain = Domain(domain, config)
            self._participant = DomainParticipant(domain)
        except DDSException as error:
            raise Kine2GoError(f"DDS cannot use the network interface '{network}': {error.msg}") from None

    def writer(self, topic: str, kind: type[Any]) -> "DataWriter[Any]":
        """Return what writes a topic."""
        return DataWriter(self._participant, Topic(self._participant, topic, kind))

    def reader(self, topic: str, kind: type[Any]) -> "DataReader[Any]":
        """Return what reads a topic; it keeps the newest message alone."""
        return DataReader(self._participant, Topic(self._participant, topic, kind))


def newest(reader: "DataReader[Any]") -> Any:
    """Return the message that has come since the last call, none if none has; a writer that ended is no message."""
    return next((sample for sample in reader.take() if isinstance(sample, idl.IdlStruct)), None)


def is_intact(sample: Any) -> bool:
    """Return whether the checksum of a ``LowCmd`` or ``LowState`` is right."""
    return sample.crc == checksum(sample)


class UnitreeLink:
    """The controller's end: states and estimates come in, commands go out."""

    def __init__(self, network: str, domain: int, sdk_index: Sequence[int], with_estimate: bool) -> None:
        """Connect.

        Args:
            network: Name of the interface.
            domain: Number of the DDS domain.
            sdk_index: Number of the motor of each of the policy's joints.
            with_estimate: Listen to ``SportModeState``, too.

        Raises:
            Kine2GoError: the interface cannot be used.
        """
        self.motors = list(sdk_index)
        wire = self._wire = Wire(network, domain)
        self._commands = wire.writer(COMMAND_TOPIC, LowCmd)
        self._states = wire.reader(STATE_TOPIC, LowState)
        self._estimates = wire.reader(ESTIMATE_TOPIC, SportModeState) if with_estimate else None
        self._state: RobotState | None = None
        self._estimate: RootEstimate | None = None
        self._command = blank(LowCmd)
        self._command.head, self._command.level_flag = list(HEAD), LOW_LEVEL
        for motor in self._command.motor_cmd:
            motor.mode, motor.q, motor.dq = SERVO, NO_POSITION, NO_VELOCITY
        self.damaged = 0
        """States whose checksum was wrong; they count as lost."""

    def state(self) -> RobotState | None:
        """Return the newest intact state, none before the first."""
        sample = newest(self._states)
        if sample is not None and not is_intact(sample):
            self.damaged += 1
        elif sample is not None:
            motors = [sample.motor_state[number] for number in self.motors]
            self._state = RobotState(
                arrival=time.monotonic(),
                sent=1e-3 * sample.tick,
                root_orientation=np.array(sample.imu_state.quaternion),
                angular_velocity_b=np.array(sample.imu_state.gyroscope),
                joint_position=np.array([motor.q for motor in motors]),
                joint_velocity=np.array([motor.dq for motor in motors]),
                joint_torque=np.array([motor.tau_est for motor in motors]),
            )
        return self._state

    def estimate(self) -> RootEstimate | None:
        """Return the newest estimate, none before the first or without an estimator."""
        sample = None if self._estimates is None else newest(self._estimates)
        if sample is not None:
            position, velocity = np.array(sample.position), np.array(sample.velocity)
            self._estimate = RootEstimate(time.monotonic(), position, velocity)
        return self._estimate

    def send(self, command: MotorCommand) -> None:
        """Send a command with its checksum."""
        for number, position in zip(self.motors, command.position, strict=True):
            motor = self._command.motor_cmd[number]
            motor.q, motor.dq = float(position), 0.0
            motor.kp, motor.kd = command.stiffness, command.damping
        self._command.crc = checksum(self._command)
        self._commands.write(self._command)
