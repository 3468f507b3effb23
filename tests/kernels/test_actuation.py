import numpy as np
import pytest
import warp as wp

from kine2go_warp.kernels.actuation import MotorModel, apply_motor_torque, push_target, targets_from_default_pose
from kine2go_warp.robots import GO2, MotorLimits
from kine2go_warp.robots.spec import FRICTION_DAMPING, FRICTION_STIFFNESS


def array(values, dtype=float):
    return wp.array(np.asarray(values), dtype=dtype)


def test_default_pose_targets_clip_the_output(rng):
    output = np.float32(rng.normal(0.0, 80.0, (50, 12)))
    target = wp.zeros((50, 12), dtype=float)
    inputs = [array(output), array(np.float32(GO2.default_joint_position)), 0.25, 100.0, target]
    wp.launch(targets_from_default_pose, dim=(50, 12), inputs=inputs)
    expected = np.array(GO2.default_joint_position) + 0.25 * np.clip(output, -100.0, 100.0)
    np.testing.assert_allclose(target.numpy(), expected, rtol=1e-5, atol=1e-6)


def motor_model(stiffness, damping, delay, strength=None, offset=None, limits=None, friction=None):
    model = MotorModel()
    for name, values in vars(limits or MotorLimits.constant(GO2.joint_effort)).items():
        setattr(model, name, array(np.float32(values)))
    model.friction = array(np.float32(np.zeros_like(stiffness) if friction is None else friction))
    model.friction_anchor = array(np.float32(np.zeros_like(stiffness)))
    model.friction_stiffness, model.friction_damping = FRICTION_STIFFNESS, FRICTION_DAMPING
    model.stiffness, model.damping = array(np.float32(stiffness)), array(np.float32(damping))
    model.strength = array(np.float32(np.ones_like(stiffness) if strength is None else strength))
    model.offset = array(np.float32(np.zeros_like(stiffness) if offset is None else offset))
    model.delay = array(delay, int)
    return model


def torques(q, qd, target, stiffness, damping, strength=None, offset=None, limits=None):
    count = len(q)
    torque = wp.zeros((count, 12), dtype=float)
    force = wp.zeros((count, 18), dtype=float)
    inputs = [
        array(np.float32(np.hstack([np.zeros((count, 7)), q]))),
        array(np.float32(np.hstack([np.zeros((count, 6)), qd]))),
        array(np.float32(target[:, None])),
        array(np.zeros(count), int),
        0,
        4,
        motor_model(stiffness, damping, np.zeros(count), strength, offset, limits),
        force,
        torque,
    ]
    wp.launch(apply_motor_torque, dim=(count, 12), inputs=inputs)
    return force.numpy(), torque.numpy()


def test_torque_is_a_clamped_pd_law_of_each_worlds_own_gains(rng):
    q, target = np.float32(rng.normal(0.0, 0.5, (2, 100, 12)))
    qd = np.float32(rng.normal(0.0, 5.0, (100, 12)))
    stiffness, damping = np.float32(rng.uniform(20.0, 80.0, (100, 12))), np.float32(rng.uniform(0.5, 3.0, (100, 12)))
    force, torque = torques(q, qd, target, stiffness, damping)
    demand = np.float64(stiffness) * (np.float64(target) - q) - np.float64(damping) * qd
    expected = np.clip(demand, -np.array(GO2.joint_effort), GO2.joint_effort)
    np.testing.assert_allclose(torque, expected, rtol=1e-5, atol=1e-5)
    np.testing.assert_array_equal(force[:, 6:], torque)
    assert np.all(force[:, :6] == 0.0)
    assert np.any(np.abs(torque) == np.float32(GO2.joint_effort)), "the test must reach the limits"


def test_strength_scales_the_torque_and_offset_shifts_the_target(rng):
    q, target = np.float32(rng.normal(0.0, 0.3, (2, 100, 12)))
    qd = np.float32(rng.normal(0.0, 3.0, (100, 12)))
    strength, offset = rng.uniform(0.7, 1.3, (100, 12)), rng.uniform(-0.1, 0.1, (100, 12))
    _, torque = torques(q, qd, target, np.full((100, 12), 40.0), np.full((100, 12), 2.0), strength, offset)
    demand = strength * (40.0 * (np.float64(target) + offset - q) - 2.0 * np.float64(qd))
    np.testing.assert_allclose(
        torque, np.clip(demand, -np.array(GO2.joint_effort), GO2.joint_effort), rtol=1e-5, atol=1e-5
    )


@pytest.mark.parametrize("delay", [0, 1, 4, 5, 8])
def test_a_target_takes_effect_after_its_delay_in_substeps(delay):
    substeps, length = 4, delay // 4 + 2
    queue = wp.full((1, length, 12), -1.0, dtype=float)
    reference_step = wp.zeros(1, dtype=int)
    seen = []
    for step in range(6):
        reference_step.fill_(step)
        inputs = [wp.full((1, 12), float(step), dtype=float), reference_step, queue]
        wp.launch(push_target, dim=(1, 12), inputs=inputs)
        for substep in range(substeps):
            torque = wp.zeros((1, 12), dtype=float)
            inputs = [
                wp.zeros((1, 19), dtype=float),
                wp.zeros((1, 18), dtype=float),
                queue,
                reference_step,
                substep,
                substeps,
                motor_model(np.ones((1, 12)), np.zeros((1, 12)), [delay]),
                wp.zeros((1, 18), dtype=float),
                torque,
            ]
            wp.launch(apply_motor_torque, dim=(1, 12), inputs=inputs)
            seen.append(float(torque.numpy()[0, 0]))
    expected = [(now - delay) // substeps if now >= delay else -1 for now in range(24)]
    assert seen == expected


def test_torques_end_on_the_motors_torque_speed_line(rng):
    """Unitree's table, written out: 20.2 N m to 13.5 rad/s, none from 30 rad/s on, 23.4 N m against the motion."""
    qd = np.float32(rng.uniform(-40.0, 40.0, (500, 12)))
    demand = rng.choice([-90.0, 90.0, -3.0, 3.0], (500, 12))
    zeros = np.zeros((500, 12))
    _, torque = torques(zeros, qd, demand / 50.0, np.full((500, 12), 50.0), zeros, limits=GO2.motor_limits)
    gear = np.tile([1.0, 1.0, 1.5], 4)
    motor_speed = np.abs(qd) * gear
    driving = np.interp(motor_speed, [13.5, 30.0], [20.2, 0.0]) * gear
    limit = np.where(demand * qd < 0.0, 23.4 * gear, driving)
    np.testing.assert_allclose(torque, np.sign(demand) * np.minimum(np.abs(demand), limit), rtol=2e-5, atol=2e-5)
    np.testing.assert_allclose(
        np.where(demand * qd < 0.0, 23.4 * gear, driving), GO2.motor_limits.available(demand, qd)
    )


def friction_forces(path, friction):
    """The torque of friction alone along the path of a joint, without a motor."""
    model = motor_model(np.zeros((1, 12)), np.zeros((1, 12)), [0], friction=np.full((1, 12), friction))
    queue, forces = wp.zeros((1, 2, 12), dtype=float), []
    for step, position in enumerate(path):
        force = wp.zeros((1, 18), dtype=float)
        state = [array(np.full((1, 19), np.float32(position))), array(np.zeros((1, 18), np.float32))]
        inputs = [*state, queue, array([step], int), 0, 4, model, force, wp.zeros((1, 12), dtype=float)]
        wp.launch(apply_motor_torque, dim=(1, 12), inputs=inputs)
        forces.append(float(force.numpy()[0, 6]))
    return np.array(forces)


def test_friction_opposes_motion_with_its_own_torque_and_none_where_an_episode_begins():
    there = np.linspace(0.3, 0.8, 51)
    forces = friction_forces(np.concatenate([there, there[::-1]]), 0.5)
    assert forces[0] == 0.0
    np.testing.assert_allclose(forces[1:51], -0.5, rtol=1e-5)
    np.testing.assert_allclose(forces[53:], 0.5, rtol=1e-5)
    # A closed path costs friction times its length, but for the springs' slack at the turn.
    work = float(np.sum(forces[1:] * np.diff(np.concatenate([there, there[::-1]]))))
    assert work == pytest.approx(-0.5 * 1.0, rel=0.02)


def test_without_friction_there_is_no_torque():
    assert not friction_forces(np.linspace(0.0, 1.0, 20), 0.0).any()
