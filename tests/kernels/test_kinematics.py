import numpy as np
import warp as wp

from kine2go_warp.env.model import leg_geometry
from kine2go_warp.kernels.kinematics import link_states
from kine2go_warp.robots import GO2
from kine2go_warp.robots.kinematics import link_positions
from tests.kernels.oracle import States, random_states, upload_robot

COM = np.array([0.0212, 0.0, -0.0054])


def kernel_links(states):
    count = len(states.position)
    position = wp.zeros((count, 16), dtype=wp.vec3, device="cpu")
    velocity = wp.zeros((count, 16), dtype=wp.vec3, device="cpu")
    inputs = [upload_robot(states, COM), leg_geometry(GO2, wp.get_device("cpu")), position, velocity]
    wp.launch(link_states, dim=(count, 4, 4), inputs=inputs, device="cpu")
    return position.numpy(), velocity.numpy()


def links_w(states):
    links = link_positions(GO2, states.joint)
    turned = np.stack([states.rotation.apply(links[:, link]) for link in range(16)], axis=1)
    return states.position[:, None] + turned


def test_positions_agree_with_numpy(rng):
    states = random_states(rng, 100)
    np.testing.assert_allclose(kernel_links(states)[0], links_w(states), rtol=1e-5, atol=2e-6)


def test_velocities_are_the_derivatives_of_the_positions(rng):
    states = random_states(rng, 100)
    step = 1e-6

    def moved(time):
        from scipy.spatial.transform import Rotation

        return States(
            states.position + time * states.linear,
            (Rotation.from_rotvec(time * states.angular) * states.rotation).as_quat(),
            states.linear,
            states.angular,
            states.joint + time * states.joint_speed,
            states.joint_speed,
        )

    expected = (links_w(moved(step)) - links_w(moved(-step))) / (2.0 * step)
    np.testing.assert_allclose(kernel_links(states)[1], expected, rtol=1e-5, atol=1e-5)
