"""The messages of Unitree's SDK and their checksum, against a second implementation and the SDK's own figures."""

import os

import numpy as np
import pytest

dds = pytest.importorskip("kine2go_warp.deployment.dds", reason="cyclonedds is not installed", exc_type=ImportError)

from kine2go_warp.deployment.robot import MotorCommand  # noqa: E402
from kine2go_warp.errors import Kine2GoError  # noqa: E402
from kine2go_warp.robots import GO2  # noqa: E402


def bit_by_bit(words):
    """The checksum as its definition says, a bit at a time: no code in common with ``dds.checksum``."""
    crc = 0xFFFFFFFF
    for word in words:
        for place in reversed(range(32)):
            carried = (crc >> 31) ^ (word >> place) & 1
            crc = (crc << 1) & 0xFFFFFFFF
            if carried:
                crc ^= 0x04C11DB7
    return crc


def filled_command():
    command = dds.blank(dds.LowCmd)
    command.head, command.level_flag, command.bandwidth, command.gpio = [0xFE, 0xEF], 0xFF, 513, 7
    command.sn, command.version, command.reserve = [1, 2], [3, 4], 99
    command.wireless_remote, command.led, command.fan = list(range(40)), list(range(12)), [8, 9]
    for place, motor in enumerate(command.motor_cmd):
        motor.mode, motor.q, motor.dq, motor.tau = 1, 0.25 * place - 2.0, 0.5 * place, place - 10.0
        motor.kp, motor.kd, motor.reserve = 60.0, 2.5, [place, 0, 1]
    return command


def filled_state():
    state = dds.blank(dds.LowState)
    state.head, state.tick, state.power_v, state.power_a = [0xFE, 0xEF], 123456, 28.5, -3.25
    state.bandwidth, state.bit_flag, state.adc_reel, state.fan_frequency = 513, 5, 0.5, [1, 2, 3, 4]
    state.foot_force, state.foot_force_est, state.temperature_ntc1 = [-1, 2, -3, 4], [5, -6, 7, -8], 31
    imu = state.imu_state
    imu.quaternion, imu.gyroscope, imu.temperature = [0.5, -0.5, 0.5, -0.5], [1.0, 2.0, -3.0], 44
    state.bms_state.current, state.bms_state.cycle, state.bms_state.cell_vol = -1500, 300, list(range(15))
    for place, motor in enumerate(state.motor_state):
        motor.mode, motor.q, motor.dq, motor.tau_est = 1, 0.25 * place - 2.0, 0.5 * place, place - 10.0
        motor.temperature, motor.lost, motor.reserve = place, 2 * place, [place, 3]
    return state


SDK_FIGURES = [
    ("blank command", lambda: dds.blank(dds.LowCmd), 1264208000),
    ("blank state", lambda: dds.blank(dds.LowState), 2247171750),
    ("command", filled_command, 3415801068),
    ("state", filled_state, 1065531860),
]
"""Made by ``unitree_sdk2py.utils.crc.CRC().Crc`` (unitree_sdk2_python at 37116c5) from messages of the same values."""


@pytest.mark.parametrize(("make", "figure"), [one[1:] for one in SDK_FIGURES], ids=[one[0] for one in SDK_FIGURES])
def test_the_checksum_is_the_sdks_and_that_of_the_definition(make, figure):
    sample = make()
    assert dds.checksum(sample) == figure
    words = np.frombuffer(dds.packed(sample), "<u4")[:-1]
    assert bit_by_bit(map(int, words)) == figure


def test_the_structures_are_as_large_as_in_the_sdk():
    """Its comments name 812 and 1180 bytes."""
    assert len(dds.packed(dds.blank(dds.LowCmd))) == 812
    assert len(dds.packed(dds.blank(dds.LowState))) == 1180


@pytest.mark.parametrize("make", [filled_command, filled_state])
def test_a_message_is_intact_after_the_wire_and_not_after_any_change(make):
    sample = make()
    sample.crc = dds.checksum(sample)
    read = type(sample).deserialize(sample.serialize())
    assert dds.is_intact(read)
    motors = read.motor_cmd if isinstance(read, dds.LowCmd) else read.motor_state
    motors[19].q += 0.5
    assert not dds.is_intact(read)
    motors[19].q -= 0.5
    assert dds.is_intact(read)
    read.crc ^= 1
    assert not dds.is_intact(read)


@pytest.fixture(scope="module")
def link():
    order = [GO2.sdk_motor_order.index(name) for name in GO2.joint_names]
    return dds.UnitreeLink("lo", 100 + os.getpid() % 100, order, with_estimate=False)


def test_a_target_reaches_the_motor_that_the_sdk_numbers_so(link):
    """Case sdk-order-on-the-page: Unitree numbers the motors FR, FL, RR, RL."""
    reader = link._wire.reader(dds.COMMAND_TOPIC, dds.LowCmd)
    link.send(MotorCommand(np.arange(12.0), 60.0, 2.0))
    command = dds.newest(reader)
    assert dds.is_intact(command)
    assert [motor.q for motor in command.motor_cmd[:12]] == [3, 4, 5, 0, 1, 2, 9, 10, 11, 6, 7, 8]
    assert {(motor.kp, motor.kd, motor.dq, motor.tau) for motor in command.motor_cmd[:12]} == {(60.0, 2.0, 0.0, 0.0)}
    assert {(motor.kp, motor.kd, motor.tau) for motor in command.motor_cmd[12:]} == {(0.0, 0.0, 0.0)}
    assert (bytes(command.head), command.level_flag) == (b"\xfe\xef", 0xFF)
    link.send(MotorCommand.damped(3.0))
    assert {(motor.kp, motor.kd) for motor in dds.newest(reader).motor_cmd[:12]} == {(0.0, 3.0)}


def test_a_state_comes_in_the_policys_order_and_a_damaged_one_is_lost(link):
    assert link.state() is None
    assert link.estimate() is None
    writer, state = link._wire.writer(dds.STATE_TOPIC, dds.LowState), filled_state()
    state.crc = dds.checksum(state)
    writer.write(state)
    read = link.state()
    np.testing.assert_allclose(read.joint_position, 0.25 * np.array([3, 4, 5, 0, 1, 2, 9, 10, 11, 6, 7, 8]) - 2.0)
    np.testing.assert_allclose(read.angular_velocity_b, (1.0, 2.0, -3.0))
    assert read.sent == pytest.approx(123.456)
    state.tick += 1
    writer.write(state)
    assert link.state() is read
    assert link.damaged == 1


def test_an_interface_that_is_not_there_is_named_with_those_that_are():
    with pytest.raises(Kine2GoError, match=r"no network interface 'eth99' on this machine; there are: .*lo"):
        dds.Wire("eth99", 0)
