import numpy as np
import warp as wp

from kine2go_warp.env.model import leg_geometry
from kine2go_warp.kernels.rewards import MAXIMUM_REWARDS, REWARD_TERMS, tracking_rewards
from kine2go_warp.robots import GO2
from tests.kernels.oracle import near, paper_rewards, random_states, upload_reference, upload_robot

COM = np.array([0.0212, 0.001, -0.0054])


def kernel_rewards(robot, reference, weights):
    count = len(robot.position)
    terms = wp.zeros((count, len(REWARD_TERMS)), dtype=float, device="cpu")
    total = wp.zeros(count, dtype=float, device="cpu")
    inputs = [upload_robot(robot, COM), upload_reference(reference), leg_geometry(GO2, wp.get_device("cpu"))]
    inputs += [wp.array(np.float32(weights), device="cpu"), terms, total]
    wp.launch(tracking_rewards, dim=count, inputs=inputs, device="cpu")
    return terms.numpy(), total.numpy()


def test_every_term_agrees_with_the_papers_equations(rng):
    reference = random_states(rng, 300)
    for scale in (1e-3, 0.03, 0.1):
        robot = near(rng, reference, scale)
        weights = np.array([0.5, 0.05, 0.2, 0.15, 0.1])
        terms, total = kernel_rewards(robot, reference, weights)
        expected = paper_rewards(robot, reference) * weights
        # What exp(-40 x) makes of the last bit of x is the most that single precision can be held to.
        np.testing.assert_allclose(terms, expected, rtol=1e-5, atol=2e-6)
        np.testing.assert_allclose(total, expected.sum(axis=1), rtol=1e-5, atol=2e-6)


def test_the_reference_itself_earns_the_maximum(rng):
    reference = random_states(rng, 64)
    terms, _ = kernel_rewards(reference, reference, np.ones(5))
    np.testing.assert_allclose(terms, np.tile(MAXIMUM_REWARDS, (64, 1)), rtol=1e-5)


def test_the_sign_of_a_quaternion_changes_nothing(rng):
    reference = random_states(rng, 100)
    robot = near(rng, reference, 0.05)
    expected, _ = kernel_rewards(robot, reference, np.ones(5))
    robot.quaternion = -robot.quaternion
    flipped, _ = kernel_rewards(robot, reference, np.ones(5))
    np.testing.assert_allclose(flipped, expected, rtol=1e-6)


def test_a_state_that_is_not_finite_earns_nothing(rng):
    reference = random_states(rng, 4)
    robot = near(rng, reference, 0.05)
    robot.joint[1, 3], robot.position[2, 0], robot.joint_speed[3, 11] = np.nan, np.inf, np.nan
    terms, total = kernel_rewards(robot, reference, np.ones(5))
    assert total[0] > 0.0
    np.testing.assert_array_equal(total[1:], 0.0)
    np.testing.assert_array_equal(terms[1:], 0.0)
