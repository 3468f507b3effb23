import numpy as np
import pytest
import warp as wp

from kine2go_warp.env.model import leg_geometry
from kine2go_warp.env.terms.base import with_term
from kine2go_warp.env.terms.rewards import REWARDS
from kine2go_warp.kernels.rewards import sum_rewards
from kine2go_warp.robots import GO2
from tests.kernels.oracle import near, paper_rewards, random_states, upload_reference, upload_robot, world_view

COM = np.array([0.0212, 0.001, -0.0054])
TRACKING = REWARDS[:5]
MAXIMA = [term.maximum for term in TRACKING]


def kernel_rewards(robot, reference, weights, tracking=TRACKING):
    count = len(robot.position)
    terms = wp.zeros((count, len(tracking)), dtype=float)
    total = wp.zeros(count, dtype=float)
    geometry = leg_geometry(GO2, wp.get_device())
    view = world_view(robot=upload_robot(robot, COM), reference=upload_reference(reference), geometry=geometry)
    with wp.ScopedDevice(wp.get_device()):
        for column, term in enumerate(tracking):
            term.launch(view, terms, column)
        inputs = [view.robot, wp.array(np.float32(weights)), terms, total]
        wp.launch(sum_rewards, dim=count, inputs=inputs)
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
    np.testing.assert_allclose(terms, np.tile(MAXIMA, (64, 1)), rtol=1e-5)


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


def test_exponents_are_settings(rng):
    reference = random_states(rng, 100)
    robot = near(rng, reference, 0.05)
    changed = with_term(TRACKING, "root_pose", position_exponent=5.0, angle_exponent=1.0)
    distance = np.sum((robot.position - reference.position) ** 2, axis=1)
    angle = (robot.rotation * reference.rotation.inv()).magnitude()
    expected = np.exp(-5.0 * distance) + np.exp(-(angle**2))
    terms, _ = kernel_rewards(robot, reference, np.ones(5), changed)
    np.testing.assert_allclose(terms[:, 3], expected, rtol=1e-5)


@pytest.mark.parametrize("penalty", [-0.25, 0.25])
def test_a_penalty_is_a_term_of_the_sum(rng, penalty):
    states = random_states(rng, 50)
    action, last = np.float32(rng.normal(size=(2, 50, 12)))
    terms = wp.zeros((50, 1), dtype=float)
    total = wp.zeros(50, dtype=float)
    view = world_view(action=wp.array(action), last_action=wp.array(last))
    with wp.ScopedDevice(wp.get_device()):
        REWARDS[5].launch(view, terms, 0)
        weights = wp.array([penalty], dtype=float)
        wp.launch(sum_rewards, dim=50, inputs=[upload_robot(states, COM), weights, terms, total])
    np.testing.assert_allclose(total.numpy(), penalty * np.sum((action - last) ** 2, axis=1), rtol=1e-5)
