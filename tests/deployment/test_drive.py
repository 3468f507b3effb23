"""The control loop against a robot in plain MuJoCo, in this process and in the simulation's own time."""

from dataclasses import replace

import numpy as np
import pytest

from kine2go_warp.deployment.controller import ExportedPolicy
from kine2go_warp.deployment.drive import Deployment, DriveConfig, check_deployable
from kine2go_warp.deployment.robot import RobotState, RootEstimate, realtime
from kine2go_warp.deployment.safety import Phase, Schedule
from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.mujoco_engine import FIRST_DOF, MujocoRobot
from kine2go_warp.errors import Kine2GoError, PolicyError
from kine2go_warp.robots import GO2

QUICK = DriveConfig(Schedule(stand_seconds=1.0, seconds=2.0, start_after=0.3, halt_seconds=0.5), robot_latency=0.0)


class RobotInProcess:
    """A link to a robot that obeys at once; its heading is whatever it is turned to."""

    def __init__(self, heading=0.0):
        self.robot, self.now, self.commands = MujocoRobot(EnvConfig(), GO2), 0.0, []
        joint_q = np.zeros(19)
        joint_q[2], joint_q[5:7] = 0.1, (np.sin(0.5 * heading), np.cos(0.5 * heading))
        joint_q[7:] = (0.0, 1.36, -2.65) * 4
        self.robot.set_state(joint_q, np.zeros(18))
        self.change = lambda state: state

    def state(self):
        data = self.robot.data
        values = (data.qpos[3:7], data.qvel[3:6], data.qpos[7:], data.qvel[FIRST_DOF:], self.robot.torque)
        return self.change(RobotState(self.now, self.now, *(np.array(value) for value in values)))

    def estimate(self):
        return RootEstimate(self.now, self.robot.data.qpos[:3].copy(), self.robot.data.qvel[:3].copy())

    def send(self, command):
        self.commands.append(command)
        error = command.position - self.robot.data.qpos[7:]
        self.robot.drive(command.stiffness * error - command.damping * self.robot.data.qvel[FIRST_DOF:])
        self.now += EnvConfig().substep_duration


def drive(policy, link, config=QUICK, until=10.0, start=False):
    """Turn by turn until the robot is damped; returns the deployment and the instants at which phases began."""
    began = {}
    deployment = Deployment(policy, link, config, on_phase=lambda phase: began.setdefault(phase, link.now))
    while deployment.turn(link.now, start) is not Phase.DAMPED and link.now < until:
        pass
    return deployment, began


@pytest.fixture(scope="module")
def loaded(bundle):
    """Returns zeros: joint targets are the clip's with its velocity fed forward."""
    return ExportedPolicy.load(bundle)


@pytest.fixture(scope="module")
def trained(trained_bundle):
    return ExportedPolicy.load(trained_bundle)


@pytest.mark.parametrize("heading", [0.0, 2.5])
def test_a_lying_robot_stands_up_tracks_wherever_it_looks_and_sinks_down(trained, heading):
    """Without an estimate of where it is."""
    check_deployable(trained, has_estimate=False)
    link = RobotInProcess(heading)
    link.estimate = lambda: None
    deployment, began = drive(trained, link)
    outcome = deployment.outcome
    assert outcome.reason == "tracked for 2 s"
    assert outcome.completed
    assert list(began) == [Phase.STANDING_UP, Phase.READY, Phase.TRACKING, Phase.HALTING, Phase.DAMPED]
    assert outcome.tracked == pytest.approx(2.0, abs=0.02)
    # The first steps from standing are in it; standing still would be off by 0.18 rad.
    assert outcome.joint_rmse < 0.06
    assert outcome.began == pytest.approx(1.3, abs=0.02)
    away = link.robot.data.qpos[:2]
    assert np.linalg.norm(away) == pytest.approx(1.2, abs=0.25)
    assert abs(np.angle(complex(*away) * np.exp(-1j * heading))) < 0.2, "it went where it looked"
    assert link.robot.data.qpos[2] > 0.25, "it still stands when it is damped"


def test_targets_come_as_late_as_in_training(loaded):
    """Outputs of a step rule from 5 turns after the state that they come from (``latency`` in deploy.yaml)."""

    class Counting:
        count = 0

        def run(self, _names, _inputs):
            self.count += 1
            return [np.full((1, 12), 1e-3 * self.count, np.float32)]

    metadata = loaded.metadata
    absolute = replace(metadata, action=replace(metadata.action, mode="absolute"))
    link = RobotInProcess()
    # A joint target of 1 mrad for all joints would make the robot fall; the motors do not obey here.
    link.robot.drive = lambda _torque: None
    _, began = drive(replace(loaded, session=Counting(), metadata=absolute), link)
    first = round(began[Phase.TRACKING] * 240)
    positions = np.array([command.position[0] for command in link.commands[first : first + 20]])
    expected = [0.0] * 5 + [1e-3] * 4 + [2e-3] * 4 + [3e-3] * 4 + [4e-3] * 3
    np.testing.assert_allclose(positions, expected, atol=1e-9)


def test_standing_up_begins_at_the_joints_and_moves_without_a_jump(loaded):
    link = RobotInProcess()
    drive(loaded, link)
    standing = np.array([command.position for command in link.commands[:300]])
    np.testing.assert_allclose(standing[0], (0.0, 1.36, -2.65) * 4, atol=1e-6)
    np.testing.assert_allclose(standing[-1], GO2.default_joint_position, atol=1e-6)
    assert np.abs(np.diff(standing, axis=0)).max() < 0.5 * np.pi * 1.15 / 240 + 1e-6


def damped_within(link, deployment, seconds):
    """Whether a robot is damped soon enough after now."""
    begin = link.now
    while deployment.turn(link.now) is not Phase.DAMPED:
        assert link.now < begin + seconds
    return link.commands[-1].stiffness == 0.0 and link.commands[-1].damping == 3.0


def test_a_jammed_motor_that_strains_is_damped(loaded):
    link = RobotInProcess()
    deployment, _ = drive(loaded, link, until=1.8)
    assert deployment.supervisor.phase is Phase.TRACKING
    link.change = lambda state: replace(state, joint_torque=np.r_[np.zeros(7), 20.0, np.zeros(4)])
    assert damped_within(link, deployment, 0.1)
    assert deployment.outcome.reason == "RL_thigh_joint is overloaded with 20 N m"
    assert not deployment.outcome.completed


def test_a_policy_that_returns_nan_is_damped_and_its_target_never_sent(loaded):
    class Broken:
        def run(self, _names, _inputs):
            return [np.full((1, 12), np.nan, np.float32)]

    link = RobotInProcess()
    deployment, _ = drive(replace(loaded, session=Broken()), link)
    assert deployment.outcome.reason == "the policy returns a number that is not finite"
    assert all(np.isfinite(command.position).all() for command in link.commands)
    assert link.commands[-1].stiffness == 0.0


def test_an_observation_that_needs_what_nobody_measures_is_refused_and_would_be_nan(loaded):
    with pytest.raises(PolicyError, match=r"linear_velocity_b and reference_position_h, .*no_state_estimation"):
        check_deployable(loaded, has_estimate=False)
    check_deployable(loaded, has_estimate=True)
    other = replace(loaded, metadata=replace(loaded.metadata, robot="a1"))
    with pytest.raises(PolicyError, match="is for the robot a1, and deploy drives a go2 alone"):
        check_deployable(other, has_estimate=True)
    link = RobotInProcess()
    link.estimate = lambda: None
    deployment, _ = drive(loaded, link)
    assert deployment.outcome.reason == "no estimate of the base's position and velocity has come"


def test_nothing_is_sent_before_a_robot_reports_and_an_error_leaves_it_damped(loaded, monkeypatch):
    monkeypatch.setattr("kine2go_warp.deployment.drive.CONNECT_SECONDS", 0.05)
    link = RobotInProcess()
    link.state = lambda: None
    with pytest.raises(Kine2GoError, match=r"no robot sent a state within 0\.05 s; nothing was sent"):
        Deployment(loaded, link, QUICK).run()
    assert not link.commands
    link = RobotInProcess()

    def fail():
        raise RuntimeError("a defect")

    with pytest.raises(RuntimeError, match="a defect"):
        Deployment(loaded, link, QUICK).run(should_start=fail)
    assert [command.stiffness for command in link.commands] == [0.0]


def test_real_time_priority_is_given_back():
    import os

    before = os.sched_getscheduler(0)
    with realtime() as is_realtime:
        assert (os.sched_getscheduler(0) == os.SCHED_RR) == is_realtime
    assert os.sched_getscheduler(0) == before
