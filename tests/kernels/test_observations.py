import numpy as np
import warp as wp
from scipy.spatial.transform import Rotation

from kine2go_warp.env.clips import make_placement, upload_clips
from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.observations import place_privileged
from kine2go_warp.env.terms.observations import OBSERVATIONS, PRIVILEGED_OBSERVATIONS, REFERENCE_OBSERVATIONS
from kine2go_warp.kernels import observations
from kine2go_warp.kernels.actuation import MotorModel
from kine2go_warp.kernels.world import BaseBody
from kine2go_warp.robots import GO2
from tests.kernels.oracle import States, random_states, reference_at, upload_robot, world_view

COM = np.array([0.0212, 0.0, -0.0054])
DEFAULT = np.array(GO2.default_joint_position)
AHEAD = (1, 2, 10, 30)


def array(values, dtype=float):
    return wp.array(np.asarray(values), dtype=dtype)


def observed(terms, view, count):
    """What the terms write, one beside the other."""
    out = wp.zeros((count, sum(term.size for term in terms)), dtype=float)
    column = 0
    with wp.ScopedDevice(wp.get_device()):
        for term in terms:
            term.launch(view, out, column)
            column += term.size
    return out.numpy()


def observe_state(states, action):
    robot, default = upload_robot(states, COM), array(np.float32(DEFAULT))
    view = world_view(robot=robot, last_action=array(np.float32(action)), default_position=default)
    return observed(OBSERVATIONS, view, len(states.position))


def observe_references(states, clip, phase, heading, origin, step):
    count, device = len(states.position), wp.get_device()
    placement = make_placement(count, device)
    placement.start_phase.assign(np.float32(phase))
    placement.heading.assign(np.float32(heading))
    placement.origin.assign(np.float32(origin))
    parts = {
        "robot": upload_robot(states, COM),
        "clips": upload_clips([clip], 1.0 / 60.0, device),
        "placement": placement,
        "reference_step": array(step, int),
        "default_position": array(np.float32(DEFAULT)),
    }
    blocks = [observed(REFERENCE_OBSERVATIONS, world_view(ahead=ahead, **parts), count) for ahead in AHEAD]
    return np.concatenate(blocks, axis=1)


def test_state_agrees_with_numpy(rng):
    states, output = random_states(rng, 200), rng.normal(0.0, 1.0, (200, 12))
    inverse = states.rotation.inv()
    expected = np.hstack(
        [
            inverse.apply([0.0, 0.0, -1.0]),
            inverse.apply(states.linear),
            inverse.apply(states.angular),
            states.joint - DEFAULT,
            states.joint_speed,
            output,
        ]
    )
    np.testing.assert_allclose(observe_state(states, output), expected, rtol=1e-5, atol=1e-5)


def test_references_agree_with_numpy(clip, rng):
    count = 60
    states = random_states(rng, count)
    phase, heading = np.float32(rng.uniform(0.0, 1.0, count)), np.float32(rng.uniform(-np.pi, np.pi, count))
    origin, step = np.float32(rng.normal(0.0, 1.0, (count, 2))), rng.integers(0, 100, count)
    found = observe_references(states, clip, phase, heading, origin, step).reshape(count, 4, 21)
    for world in range(count):
        for target, ahead in enumerate(AHEAD):
            frame = float(phase[world]) * clip.num_frames + step[world] + ahead
            reference = reference_at(clip, frame, float(heading[world]), origin[world])
            level = Rotation.from_euler("z", -states.yaw[world])
            rotation = level * Rotation.from_quat(reference.quaternion[0])
            expected = np.concatenate(
                [
                    level.apply(reference.position[0] - states.position[world]),
                    rotation.apply([1.0, 0.0, 0.0]),
                    rotation.apply([0.0, 1.0, 0.0]),
                    reference.joint[0] - DEFAULT,
                ]
            )
            np.testing.assert_allclose(found[world, target], expected, rtol=1e-5, atol=2e-5)


def test_turning_and_moving_world_and_reference_together_changes_nothing(clip, rng):
    count = 64
    states = random_states(rng, count)
    # Upright enough for a heading: a robot that looks straight up has none.
    tilt = Rotation.from_euler("yx", rng.uniform(-0.5, 0.5, (count, 2)))
    states.quaternion = (Rotation.from_euler("z", rng.uniform(-3.0, 3.0, (count, 1))) * tilt).as_quat()
    phase, step = np.float32(rng.uniform(0.0, 1.0, count)), rng.integers(0, 60, count)
    turn, shift = 2.7, np.array([3.0, -1.0])
    rotation = Rotation.from_rotvec([0.0, 0.0, turn])
    moved = States(
        rotation.apply(states.position) + np.append(shift, 0.0),
        (rotation * states.rotation).as_quat(),
        rotation.apply(states.linear),
        rotation.apply(states.angular),
        states.joint,
        states.joint_speed,
    )
    output = np.zeros((count, 12))
    np.testing.assert_allclose(observe_state(moved, output), observe_state(states, output), atol=2e-5)
    zeros = np.zeros((count, 2))
    here = observe_references(states, clip, phase, np.zeros(count), zeros, step)
    there = observe_references(moved, clip, phase, np.full(count, turn), zeros + shift, step)
    np.testing.assert_allclose(there, here, atol=2e-5)


def test_history_moves_back_and_is_filled_when_an_episode_begins():
    observation = array(np.zeros((2, 3 * 45), dtype=np.float32))
    for value in (1.0, 2.0, 3.0):
        wp.launch(observations.shift_history, dim=(2, 45), inputs=[observation, 3, 45])
        filled = observation.numpy()
        filled[:, :45] = value
        observation.assign(filled)
        done = array([0, int(value == 3.0)], wp.int64)
        wp.launch(observations.fill_history, dim=(2, 45), inputs=[done, observation, 3, 45])
    newest_first = observation.numpy().reshape(2, 3, 45)[:, :, 0]
    np.testing.assert_array_equal(newest_first, [[3.0, 2.0, 1.0], [3.0, 3.0, 3.0]])


def test_privileged_observations_agree_with_numpy(rng):
    count = 40
    states = random_states(rng, count)
    tilt = Rotation.from_euler("yx", rng.uniform(-0.5, 0.5, (count, 2)))
    states.quaternion = (Rotation.from_euler("z", rng.uniform(-3.0, 3.0, (count, 1))) * tilt).as_quat()
    force = np.float32(rng.normal(0.0, 100.0, (count, 4, 3)))
    motors, base = MotorModel(), BaseBody()
    factors = np.float32(rng.uniform(0.8, 1.2, (4, count, 12)))
    motors.stiffness, motors.damping = array(60.0 * factors[0]), array(2.0 * factors[1])
    motors.strength, motors.offset = array(factors[2]), array(factors[3])
    joint_friction = np.float32(rng.uniform(0.0, 1.0, (count, 12)))
    motors.friction = array(joint_friction)
    delay = rng.integers(0, 9, count)
    motors.delay = array(delay, int)
    mass, com = np.float32(rng.normal(0.0, 1.0, count)), np.float32(rng.normal(0.0, 0.02, (count, 3)))
    base.nominal_mass, base.nominal_com = 7.0, wp.vec3(0.02, 0.0, -0.01)
    base.mass, base.com = array(7.0 + mass), array(com + np.float32([0.02, 0.0, -0.01]), wp.vec3)
    friction = np.float32(rng.uniform(0.4, 1.2, count))
    view = world_view(
        robot=upload_robot(states, COM),
        placement=make_placement(count, wp.get_device()),
        foot_force=array(force, wp.vec3),
        motors=motors,
        base=base,
        friction=array(friction),
        nominal_stiffness=60.0,
        nominal_damping=2.0,
        robot_weight=150.0,
    )
    out = observed(PRIVILEGED_OBSERVATIONS, view, count)
    level = Rotation.from_euler("z", -states.yaw[:, None])
    expected = {
        "root_height": states.position[:, 2:],
        "linear_velocity_h": level.apply(states.linear),
        "angular_velocity_h": level.apply(states.angular),
        "foot_force_h": np.concatenate([level.apply(force[:, foot]) for foot in range(4)], axis=1) / 150.0,
        "base_mass": mass[:, None],
        "base_com": com,
        "friction": friction[:, None],
        "stiffness": factors[0] - 1.0,
        "damping": factors[1] - 1.0,
        "strength": factors[2] - 1.0,
        "motor_offset": factors[3],
        "latency": delay[:, None],
        "joint_friction": joint_friction,
    }
    for placed in place_privileged(EnvConfig()):
        found = out[:, placed.field.start : placed.field.stop]
        np.testing.assert_allclose(found, expected[placed.term.name], rtol=1e-5, atol=5e-6, err_msg=placed.term.name)
