"""The physics, against what mechanics says and against MuJoCo's C engine."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from kine2go_warp.env import model
from kine2go_warp.env.config import ActionConfig, MotorConfig
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.mujoco_engine import MujocoRobot, mujoco_model
from kine2go_warp.env.simulation import GRAVITY, Simulation
from kine2go_warp.env.terms.randomization import randomized
from kine2go_warp.env.terms.terminations import with_limits
from kine2go_warp.learning.presets import FAST, PAPER, ROBUST
from kine2go_warp.robots import GO2
from kine2go_warp.robots.spec import FRICTION_STIFFNESS
from tests.env.helpers import STILL, assert_same_bits, drive

ENDLESS = with_limits(1e3, 10.0)


@pytest.fixture(scope="module")
def target_config(small_config):
    """The output is the joint target itself, and nothing ends an episode."""
    return replace(
        small_config,
        num_worlds=2,
        action=ActionConfig("absolute", latency=0.02),
        reset=STILL,
        terminations=ENDLESS,
        episode_time=60.0,
    )


def lift(environment, height):
    """Raises the robots off the ground."""
    joint_q = environment.robot.joint_q.numpy()
    joint_q[:, 2] += height
    environment.robot.joint_q.assign(joint_q)


def test_a_standing_robots_feet_bear_its_weight(standing_clip, small_config):
    config = replace(small_config, reset=STILL, motor=MotorConfig(60.0, 2.0))
    environment = ImitationEnvironment([standing_clip], config, "cpu")
    for _ in range(120):
        environment.step()
    force = environment.simulation.foot_force.numpy()
    weight = environment.simulation.robot_weight
    np.testing.assert_allclose(force[..., 2].sum(axis=1), weight, rtol=0.01)
    assert force[..., 2].min() > 0.1 * weight, "every foot stands"
    np.testing.assert_allclose(force[..., :2].sum(axis=1), 0.0, atol=0.02 * weight)
    assert not environment.simulation.body_contact.numpy().any()


def test_a_robot_in_the_air_falls_freely(standing_clip, target_config):
    environment = ImitationEnvironment([standing_clip], target_config, "cpu")
    lift(environment, 3.0)
    start = environment.robot.joint_q.numpy()[:, 2].copy()
    environment.action.assign(np.tile(np.float32(GO2.default_joint_position), (2, 1)))
    for _ in range(30):
        environment.step()
    steps, duration = 30 * target_config.substeps, target_config.substep_duration
    # Semi-implicit Euler falls by g dt^2 (1 + 2 + ... + n); the motors hold the legs, so that nothing else moves.
    fallen = GRAVITY * duration**2 * steps * (steps + 1) / 2.0
    np.testing.assert_allclose(start - environment.robot.joint_q.numpy()[:, 2], fallen, rtol=1e-4)
    np.testing.assert_allclose(environment.robot.joint_qd.numpy()[:, 2], -GRAVITY * steps * duration, rtol=1e-5)
    assert not environment.simulation.foot_force.numpy().any()


def test_feet_that_slide_resist_with_the_coefficient_of_friction(standing_clip, target_config):
    config = replace(target_config, motor=MotorConfig(300.0, 5.0), solver=replace(target_config.solver, friction=0.5))
    environment = ImitationEnvironment([standing_clip], config, "cpu")
    environment.action.assign(np.tile(np.float32(GO2.default_joint_position), (2, 1)))
    for _ in range(30):
        environment.step()
    joint_qd = environment.robot.joint_qd.numpy()
    joint_qd[:, 0] += 1.0
    environment.robot.joint_qd.assign(joint_qd)
    for _ in range(3):
        environment.step()
    force = environment.simulation.foot_force.numpy().astype(float)
    foot = force.sum(axis=1)
    assert environment.robot.joint_qd.numpy()[0, 0] > 0.3, "the robot must still slide"
    # The friction pyramid's edges lie along the axes of each contact, of which nobody chooses the direction.
    ratio = np.linalg.norm(foot[:, :2], axis=1) / foot[:, 2]
    assert np.all((ratio > 0.5 * 0.95) & (ratio < 0.5 * np.sqrt(2.0) + 1e-3)), ratio
    assert np.all(foot[:, 0] < 0.0), "friction points against the motion"


def test_friction_never_leaves_its_pyramid(clip, small_config):
    steps = drive(ImitationEnvironment([clip], small_config, "cpu"), 60, 5)
    force = np.stack([step["foot_force"] for step in steps]).astype(float)
    assert force[..., 2].min() >= 0.0, "the ground never pulls"
    assert force[..., 2].max() > 50.0
    tangential = np.linalg.norm(force[..., :2], axis=-1)
    # A pyramid's corners reach beyond the cone that it stands for, by a factor of sqrt(2) at most.
    assert np.all(tangential <= np.sqrt(2.0) * small_config.solver.friction * force[..., 2] + 1e-2)


def test_torques_never_exceed_the_motors_limits(clip, small_config):
    motor = MotorConfig(500.0, 2.0, torque_speed=False)
    environment = ImitationEnvironment([clip], replace(small_config, motor=motor), "cpu")
    torque = np.stack([step["torque"] for step in drive(environment, 20, 3)])
    assert np.all(np.abs(torque) <= np.float32(GO2.joint_effort))
    assert np.any(np.abs(torque) == np.float32(GO2.joint_effort)), "the test must reach them"


def test_a_joint_answers_a_step_of_its_target_as_a_damped_oscillator(standing_clip, target_config):
    """In free fall a small step obeys ``I q'' = kp (target - q) - kd q'``, with ``1 / I`` from the mass matrix."""
    config = replace(target_config, motor=MotorConfig(30.0, 0.6), action=ActionConfig("absolute", latency=0.0))
    config = replace(config, substeps=8)
    environment = ImitationEnvironment([standing_clip], config, "cpu")
    lift(environment, 10.0)
    model, joint, step = mujoco_model(GO2, config), 1, 0.02
    data = mujoco.MjData(model)
    data.qpos[:] = np.concatenate([[0, 0, 10, 1, 0, 0, 0], GO2.default_joint_position])
    mujoco.mj_forward(model, data)
    mass = np.zeros((18, 18))
    mujoco.mj_fullM(model, data, mass)
    # The other motors hold their joints with the same law: all joints together are a linear system.
    inverse = np.linalg.inv(mass)[6:, 6:]
    target = np.zeros(12)
    target[joint] = step

    def motion(_time, state):
        return np.concatenate([state[12:], inverse @ (30.0 * (target - state[:12]) - 0.6 * state[12:])])

    times = np.arange(1, 31) / config.control_rate
    expected = solve_ivp(motion, (0.0, 0.5), np.zeros(24), t_eval=times, rtol=1e-8, atol=1e-10).y[joint]
    output = np.tile(np.float32(np.array(GO2.default_joint_position) + target), (2, 1))
    seen = []
    for _ in times:
        environment.action.assign(output)
        environment.step()
        seen.append(environment.robot.joint_q.numpy()[0, 7 + joint] - GO2.default_joint_position[joint])
    assert max(expected) > 1.2 * step, "it must overshoot for the test to tell anything about damping"
    np.testing.assert_allclose(seen, expected, atol=0.05 * step)


def test_the_c_engine_follows_the_same_two_seconds_of_joint_targets(standing_clip, target_config):
    """The same model, targets and latency in MuJoCo's C engine: within 0.1 mm, 1e-4 rad and 2 mm/s after 2 s."""
    environment = ImitationEnvironment([standing_clip], target_config, "cpu")
    robot = MujocoRobot(target_config, GO2)
    robot.set_state(environment.robot.joint_q.numpy()[0], environment.robot.joint_qd.numpy()[0])
    amplitude, offset = np.tile([0.0, 0.25, -0.25], 4), np.repeat([0.0, np.pi, np.pi, 0.0], 3)
    heights, forces = [], []
    for step in range(120):
        swing = amplitude * np.sin(2.0 * np.pi * step / 60.0 + offset) * min(1.0, step / 30.0)
        target = np.float32(GO2.default_joint_position + swing)
        environment.action.assign(np.tile(target, (2, 1)))
        environment.step()
        robot.step(target)
        joint_q, joint_qd = robot.state()
        np.testing.assert_allclose(environment.robot.joint_q.numpy()[0], joint_q, atol=1e-4)
        np.testing.assert_allclose(environment.robot.joint_qd.numpy()[0], joint_qd, atol=2e-3)
        heights.append(joint_q[2])
        forces.append(environment.simulation.foot_force.numpy()[0, :, 2].copy())
    assert np.ptp(heights) > 0.02, "the robot must move"
    assert (np.array(forces) == 0.0).any(axis=0).all(), "every foot must leave the ground at times"


@pytest.mark.parametrize("folded", [False, True], ids=["stretched", "folded"])
def test_stops_are_nearly_critical_whatever_the_inertia(standing_clip, target_config, folded):
    """Each joint meets each stop at its motor's full speed: it goes little beyond, and does not bounce."""
    limp = replace(target_config, num_worlds=6, motor=MotorConfig(1e-6, 0.0))
    environment = ImitationEnvironment([standing_clip], limp, "cpu")
    lift(environment, 10.0)
    joint_q, joint_qd = environment.robot.joint_q.numpy(), np.zeros((6, 18), np.float32)
    sign = np.tile([-1.0, 1.0], 3)
    for world in range(6):
        joint = world // 2
        joint_q[world, 7:10] = (0.0, 0.8, -2.6 if folded else -0.9)
        limit = (GO2.joint_lower if sign[world] < 0 else GO2.joint_upper)[joint]
        joint_q[world, 7 + joint] = limit - 0.1 * sign[world]
        joint_qd[world, 6 + joint] = sign[world] * GO2.joint_speed[joint]
    environment.robot.joint_q.assign(joint_q)
    environment.robot.joint_qd.assign(joint_qd)
    beyond, speed = [], []
    for _ in range(10):
        environment.simulation.advance(environment.motors, environment.episodes.reference_step)
        joint_q, joint_qd = environment.robot.joint_q.numpy(), environment.robot.joint_qd.numpy()
        for world in range(6):
            joint = world // 2
            limit = (GO2.joint_lower if sign[world] < 0 else GO2.joint_upper)[joint]
            beyond.append(sign[world] * (joint_q[world, 7 + joint] - limit))
            speed.append(sign[world] * joint_qd[world, 6 + joint] / GO2.joint_speed[joint])
    beyond, speed = np.reshape(beyond, (10, 6)), np.reshape(speed, (10, 6))
    assert np.all(beyond.max(axis=0) > 0.0), "every stop must be met"
    assert beyond.max() < 0.1
    assert speed.min() > -0.3


def swung(environment, joint, speed, torque, steps):
    """Positions and velocities of a joint of world 0 in the air, step by step, under a constant torque demanded."""
    lift(environment, 100.0)
    joint_qd = np.zeros((2, 18), np.float32)
    joint_qd[:, 6 + joint] = speed
    environment.robot.joint_qd.assign(joint_qd)
    target = environment.robot.joint_q.numpy()[:, 7:].copy()
    target[:, joint] += torque / environment.config.motor.stiffness
    seen = []
    for _ in range(steps):
        environment.action.assign(target)
        environment.step()
        seen.append((environment.robot.joint_q.numpy()[0, 7 + joint], environment.robot.joint_qd.numpy()[0, 6 + joint]))
    return np.array(seen).T


def limp(target_config, **motor):
    action = ActionConfig("absolute", latency=0.0)
    return replace(target_config, motor=MotorConfig(1e-3, 0.0, **motor), action=action)


@pytest.mark.parametrize("joint", range(3))
def test_friction_stops_a_joint_where_mujocos_own_friction_does(standing_clip, target_config, joint):
    """A turning joint without a motor comes to rest, against ``frictionloss`` rows of MuJoCo's C engine."""
    config = limp(target_config, friction=1.0)
    environment = ImitationEnvironment([standing_clip], config, "cpu")
    position, velocity = swung(environment, joint, 4.0, 0.0, 30)
    model = mujoco_model(GO2, config)
    model.dof_frictionloss[6:] = GO2.joint_friction
    data = mujoco.MjData(model)
    data.qpos[:] = np.concatenate([[0, 0, 10, 1, 0, 0, 0], GO2.default_joint_position])
    data.qvel[6 + joint] = 4.0
    expected = []
    for _ in range(30):
        for _ in range(config.substeps):
            mujoco.mj_step(model, data)
        expected.append(data.qpos[7 + joint])
    travel = expected[-1] - GO2.default_joint_position[joint]
    assert travel > 0.05
    np.testing.assert_allclose(position, expected, atol=0.06 * travel)
    assert abs(velocity[-1]) < 0.05


@pytest.mark.parametrize("joint", range(3))
def test_a_joint_held_by_friction_does_not_creep(standing_clip, target_config, joint):
    environment = ImitationEnvironment([standing_clip], limp(target_config, friction=1.0), "cpu")
    torque = 0.6 * GO2.joint_friction[joint]
    position, velocity = swung(environment, joint, 0.0, torque, 180)
    assert abs(position[-1] - GO2.default_joint_position[joint]) < 1.2 * torque / FRICTION_STIFFNESS
    assert abs(position[-1] - position[120]) < 2e-4, "one second later it must be where it was"
    assert abs(velocity[-1]) < 1e-2


@pytest.mark.parametrize(("joint", "sign"), [(0, 1.0), (1, -1.0), (2, 1.0), (2, -1.0)])
def test_a_joint_turned_from_stop_to_stop_never_exceeds_its_motors_speed(standing_clip, target_config, joint, sign):
    """Case 05-motor-speed."""
    # The other joints are held; the driven one has a target so far beyond its stop that all the torque is demanded.
    # 100 kg more hold the base still: a free one turns on against the leg, up to 2 % beyond the motor's speed.
    still = randomized(base_mass=(100.0, 100.0))
    config = replace(limp(target_config), motor=MotorConfig(60.0, 2.0), randomization=still)
    environment = ImitationEnvironment([standing_clip], config, "cpu")
    joint_q = environment.robot.joint_q.numpy().copy()
    joint_q[:, 7 + joint] = (GO2.joint_lower if sign > 0 else GO2.joint_upper)[joint] + 0.01 * sign
    environment.robot.joint_q.assign(joint_q)
    position, velocity = swung(environment, joint, 0.0, sign * 900.0, 20)
    reached = np.abs(velocity[(position > GO2.joint_lower[joint]) & (position < GO2.joint_upper[joint])]).max()
    # No torque drives it beyond; the calf has up to 0.5 % more, for the held motor lets the thigh give way a little.
    assert 0.3 * GO2.joint_speed[joint] < reached <= 1.006 * GO2.motor_limits.no_load_speed[joint]
    config = replace(config, motor=replace(config.motor, torque_speed=False))
    unlimited = ImitationEnvironment([standing_clip], config, "cpu")
    unlimited.robot.joint_q.assign(joint_q)
    _, velocity = swung(unlimited, joint, 0.0, sign * 900.0, 20)
    assert np.abs(velocity).max() > reached, "without the line it must be faster"


def test_the_integrators_joint_damping_changes_nothing_on_joints_without_damping(clip, small_config, monkeypatch):
    """MuJoCo's ``EULERDAMP`` is switched off: it would factorise the mass matrix a second time for nothing."""
    without = drive(ImitationEnvironment([clip], small_config, "cpu"), 20, seed=3)
    monkeypatch.setattr(model, "ABSENT", 0)
    damped = ImitationEnvironment([clip], small_config, "cpu")
    assert not damped.simulation.solver.mjw_model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP)
    for one, other in zip(without, drive(damped, 20, seed=3), strict=True):
        np.testing.assert_allclose(one["joint_q"], other["joint_q"], atol=2e-5)
        assert np.array_equal(one["done"], other["done"])


def newtons_own_step(self, motors, reference_step):
    """The substeps of a control step by Newton's public interface, from one of its states to another."""
    states, control = [self.model.state(), self.model.state()], self.model.control()
    views = [(state.joint_q.reshape((-1, 19)), state.joint_qd.reshape((-1, 18))) for state in states]
    for view, mine in zip(views[0], (self.robot.joint_q, self.robot.joint_qd), strict=True):
        view.assign(mine)
    for substep in range(self.config.substeps):
        now = substep % 2
        motors.apply(substep, reference_step, *views[now], control.joint_f.reshape((-1, 18)))
        self.solver.step(states[now], states[1 - now], control, None, self.config.substep_duration)
    for view, mine in zip(views[0], (self.robot.joint_q, self.robot.joint_qd), strict=True):
        mine.assign(view)


@pytest.mark.parametrize("preset", [FAST, ROBUST, PAPER], ids=["fast", "robust", "paper"])
def test_a_control_step_is_that_of_newtons_own_solver_bit_for_bit(clip, monkeypatch, preset):
    """Neither stepping MuJoCo Warp directly nor leaving out what the robot has none of changes a bit."""
    config = replace(preset.env, num_worlds=4, episode_time=0.3)
    lean = drive(ImitationEnvironment([clip], config, "cpu", use_graph=False), 30, seed=4)
    assert sum(step["done"].sum() for step in lean) > 0, "episodes must begin anew"
    monkeypatch.setattr(model, "ABSENT", int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP))
    monkeypatch.setattr(Simulation, "advance", newtons_own_step)
    full = ImitationEnvironment([clip], config, "cpu", use_graph=False)
    assert not full.simulation.solver.mjw_model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_SPRING)
    assert_same_bits(lean, drive(full, 30, seed=4))


def test_the_reference_keeps_to_the_motors_torque_speed_line(clip):
    """Inertia of the legs and friction of the joints alone, the base held still, need half of what motors give."""
    model = mujoco_model(GO2, FAST.env)
    data, mass = mujoco.MjData(model), np.zeros((18, 18))
    velocity = clip.joint_velocity.astype(float)
    acceleration = (np.roll(velocity, -1, 0) - np.roll(velocity, 1, 0)) / (2.0 * clip.frame_duration)
    torques = []
    for position, qd, qdd in zip(clip.joint_position, velocity, acceleration, strict=True):
        data.qpos[:] = np.concatenate([[0, 0, 10, 1, 0, 0, 0], position])
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, mass)
        torques.append(mass[6:, 6:] @ qdd + np.array(GO2.joint_friction) * np.sign(qd))
    used = np.abs(torques) / GO2.motor_limits.available(np.array(torques), velocity)
    assert 0.05 < used.max() < 0.5
