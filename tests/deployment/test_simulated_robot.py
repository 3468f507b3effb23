"""What the simulated robot measures by, against the controller's own playing of a clip."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("kine2go_warp.deployment.dds", reason="cyclonedds is not installed", exc_type=ImportError)

from kine2go_warp.deployment.reference import PlacedClip
from kine2go_warp.deployment.simulated_robot import SimulatedRobot, played, travelled
from kine2go_warp.env.config import EnvConfig
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.motions.cycle import CycleStep
from kine2go_warp.robots import GO2
from tests.conftest import COMMITTED_CLIP

TROT = MotionClip.load(COMMITTED_CLIP)
CLIPS = {
    "straight": TROT,
    "turning": replace(TROT, frame_duration=0.02, cycle=CycleStep(TROT.cycle.x, 0.1, 0.4)),
    "once": replace(TROT, cycle=None),
}


@pytest.mark.parametrize("name", CLIPS)
def test_the_simulator_plays_a_clip_as_the_controller_does(name):
    clip = CLIPS[name]
    placed = PlacedClip(clip, 60.0)
    times = np.linspace(0.0, 5.0 * clip.period, 97)
    expected = [placed.joint_position(60.0 * time) for time in times]
    np.testing.assert_allclose(played(clip, times), expected, atol=1e-9)
    for cycles in (0.5, 1.0, 3.2):
        frame = round(cycles * clip.num_frames)
        away = placed.root(60.0 * frame * clip.frame_duration).position - placed.root(0.0).position
        assert travelled(clip, frame * clip.frame_duration) == pytest.approx(np.linalg.norm(away[:2]), abs=1e-9)


def test_a_command_moves_the_joint_of_its_motor_and_damping_is_no_command():
    robot = SimulatedRobot(GO2, EnvConfig())
    assert not robot.is_damped
    from kine2go_warp.deployment.dds import LowCmd, blank

    command = blank(LowCmd)
    for motor in command.motor_cmd[:12]:
        motor.kd = 2.0
    robot.obey(command)
    assert robot.is_damped
    command.motor_cmd[GO2.sdk_motor_order.index("RL_hip_joint")].tau = 5.0
    robot.obey(command)
    assert not robot.is_damped
    before = np.array([motor.q for motor in robot.state().motor_state[:12]])
    for _ in range(10):
        robot.advance()
    moved = np.array([motor.q for motor in robot.state().motor_state[:12]]) - before
    assert GO2.sdk_motor_order[int(np.argmax(np.abs(moved)))] == "RL_hip_joint"
    assert moved[GO2.sdk_motor_order.index("RL_hip_joint")] > 0.01


def test_its_clock_and_sensors_are_those_of_a_robot_that_lies():
    robot = SimulatedRobot(GO2, EnvConfig())
    robot.damp()
    assert robot.is_damped
    for _ in range(120):
        robot.advance()
    state = robot.state()
    np.testing.assert_allclose(np.abs(state.imu_state.quaternion), (1.0, 0.0, 0.0, 0.0), atol=0.05)
    assert robot.estimate().position[2] < 0.15
