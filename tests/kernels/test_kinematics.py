import numpy as np
import warp as wp
from scipy.spatial.transform import Rotation

from kine2go_warp.env.model import leg_geometry
from kine2go_warp.env.mujoco_engine import mujoco_model
from kine2go_warp.kernels.kinematics import link_states
from kine2go_warp.learning.presets import FAST
from kine2go_warp.robots import GO2
from kine2go_warp.robots.compiled import mujoco
from kine2go_warp.robots.kinematics import link_positions
from tests.kernels.oracle import States, random_states, upload_robot

COM = np.array([0.0212, 0.0, -0.0054])


def kernel_links(states):
    count = len(states.position)
    kinds = {"position": wp.vec3, "orientation": wp.vec4, "velocity": wp.vec3, "angular_velocity": wp.vec3}
    arrays = {name: wp.zeros((count, 16), dtype=kind) for name, kind in kinds.items()}
    inputs = [upload_robot(states, COM), leg_geometry(GO2, wp.get_device()), *arrays.values()]
    wp.launch(link_states, dim=(count, 4, 4), inputs=inputs)
    return {name: array.numpy() for name, array in arrays.items()}


def links_w(states):
    links = link_positions(GO2, states.joint)
    turned = np.stack([states.rotation.apply(links[:, link]) for link in range(16)], axis=1)
    return states.position[:, None] + turned


def moved(states, time):
    return States(
        states.position + time * states.linear,
        (Rotation.from_rotvec(time * states.angular) * states.rotation).as_quat(),
        states.linear,
        states.angular,
        states.joint + time * states.joint_speed,
        states.joint_speed,
    )


def mujoco_links(states):
    """Orientations (w, x, y, z) and angular velocities of the links by plain MuJoCo, shape [num_states, 16, ...]."""
    model = mujoco_model(GO2, FAST.env)
    data = mujoco.MjData(model)
    bodies = [model.body(name.replace("foot", "calf")).id for name in GO2.link_names]
    orientation, angular = np.zeros((len(states.position), 16, 4)), np.zeros((len(states.position), 16, 3))
    for index, rotation in enumerate(states.rotation):
        data.qpos[:] = np.r_[states.position[index], rotation.as_quat()[[3, 0, 1, 2]], states.joint[index]]
        data.qvel[:] = np.r_[np.zeros(3), rotation.inv().apply(states.angular[index]), states.joint_speed[index]]
        mujoco.mj_forward(model, data)
        for link, body in enumerate(bodies):
            orientation[index, link] = data.xquat[body]
            velocity = np.zeros(6)
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, body, velocity, 0)
            angular[index, link] = velocity[:3]
    return orientation, angular


def test_orientations_and_angular_velocities_are_those_of_plain_mujoco(rng):
    states = random_states(rng, 50)
    found, (orientation, angular) = kernel_links(states), mujoco_links(states)
    same = np.sum(found["orientation"] * orientation, axis=-1, keepdims=True)
    np.testing.assert_allclose(found["orientation"] * np.sign(same), orientation, atol=2e-6)
    np.testing.assert_allclose(found["angular_velocity"], angular, rtol=1e-5, atol=1e-5)


def test_positions_agree_with_numpy(rng):
    states = random_states(rng, 100)
    np.testing.assert_allclose(kernel_links(states)["position"], links_w(states), rtol=1e-5, atol=2e-6)


def test_velocities_are_the_derivatives_of_the_positions(rng):
    states = random_states(rng, 100)
    step = 1e-6
    expected = (links_w(moved(states, step)) - links_w(moved(states, -step))) / (2.0 * step)
    np.testing.assert_allclose(kernel_links(states)["velocity"], expected, rtol=1e-5, atol=1e-5)
