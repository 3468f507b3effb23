import numpy as np
import warp as wp
from scipy.spatial.transform import Rotation

from kine2go_warp.env.clips import make_placement, upload_clips
from kine2go_warp.env.observations import privileged_layout
from kine2go_warp.kernels import observations
from kine2go_warp.kernels.actuation import MotorModel
from kine2go_warp.kernels.world import BaseBody
from kine2go_warp.robots import GO2
from tests.kernels.oracle import States, random_states, reference_at, upload_robot

COM = np.array([0.0212, 0.0, -0.0054])
DEFAULT = np.array(GO2.default_joint_position)
AHEAD = (1, 2, 10, 30)


def array(values, dtype=float):
    return wp.array(np.asarray(values), dtype=dtype, device="cpu")


def observe_state(states, output):
    count = len(states.position)
    observation = wp.zeros((count, 45), dtype=float, device="cpu")
    inputs = [upload_robot(states, COM), array(np.float32(output)), array(np.float32(DEFAULT)), observation]
    wp.launch(observations.observe_state, dim=count, inputs=inputs, device="cpu")
    return observation.numpy()


def observe_targets(states, clip, phase, heading, origin, step):
    count, device = len(states.position), wp.get_device("cpu")
    placement = make_placement(count, device)
    placement.start_phase.assign(np.float32(phase))
    placement.heading.assign(np.float32(heading))
    placement.origin.assign(np.float32(origin))
    observation = wp.zeros((count, 84), dtype=float, device=device)
    inputs = [upload_robot(states, COM), upload_clips([clip], 1.0 / 60.0, device), placement, array(step, int)]
    inputs += [array(AHEAD, int), array(np.float32(DEFAULT)), 0, observation]
    wp.launch(observations.observe_targets, dim=(count, 4), inputs=inputs, device=device)
    return observation.numpy()


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


def test_targets_agree_with_numpy(clip, rng):
    count = 60
    states = random_states(rng, count)
    phase, heading = np.float32(rng.uniform(0.0, 1.0, count)), np.float32(rng.uniform(-np.pi, np.pi, count))
    origin, step = np.float32(rng.normal(0.0, 1.0, (count, 2))), rng.integers(0, 100, count)
    found = observe_targets(states, clip, phase, heading, origin, step).reshape(count, 4, 21)
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
    here = observe_targets(states, clip, phase, np.zeros(count), zeros, step)
    there = observe_targets(moved, clip, phase, np.full(count, turn), zeros + shift, step)
    np.testing.assert_allclose(there, here, atol=2e-5)


def test_history_moves_back_and_is_filled_when_an_episode_begins():
    observation = array(np.zeros((2, 3 * 45), dtype=np.float32))
    for value in (1.0, 2.0, 3.0):
        wp.launch(observations.shift_history, dim=(2, 45), inputs=[observation, 3], device="cpu")
        filled = observation.numpy()
        filled[:, :45] = value
        observation.assign(filled)
        done = array([0, int(value == 3.0)], wp.int64)
        wp.launch(observations.fill_history, dim=(2, 45), inputs=[done, observation, 3], device="cpu")
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
    delay = rng.integers(0, 9, count)
    motors.delay = array(delay, int)
    mass, com = np.float32(rng.normal(0.0, 1.0, count)), np.float32(rng.normal(0.0, 0.02, (count, 3)))
    base.nominal_mass, base.nominal_com = 7.0, wp.vec3(0.02, 0.0, -0.01)
    base.mass, base.com = array(7.0 + mass), array(com + np.float32([0.02, 0.0, -0.01]), wp.vec3)
    friction = np.float32(rng.uniform(0.4, 1.2, count))
    out = wp.zeros((count, 73), dtype=float, device="cpu")
    placement = make_placement(count, wp.get_device("cpu"))
    robot, shown = upload_robot(states, COM), array(force, wp.vec3)
    inputs = [robot, placement, shown, motors, base, array(friction), 60.0, 2.0, 150.0, out]
    wp.launch(observations.observe_privileged, dim=count, inputs=inputs, device="cpu")
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
    }
    for field in privileged_layout():
        found = out.numpy()[:, field.start : field.stop]
        np.testing.assert_allclose(found, expected[field.name], rtol=1e-5, atol=5e-6, err_msg=field.name)
