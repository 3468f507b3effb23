"""The Earth Mover's Distance: what every such distance must satisfy, and a solver of another kind."""

import itertools
import time

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation

from kine2go_warp.robots import GO2
from kine2go_warp.robots.kinematics import link_positions
from kine2go_warp.scores.transport import (
    body_distance,
    body_states,
    distance_per_trajectory,
    earth_movers_distance,
    evenly_spaced,
    joint_distance,
)


@pytest.fixture
def sets(rng):
    return rng.normal(size=(40, 5)), rng.normal(size=(40, 5)) + 0.5


def test_the_distance_of_a_translated_set_is_the_translation(sets):
    shift = np.array([0.3, 0.0, -0.4, 1.2, 0.0])
    assert earth_movers_distance(sets[0], sets[0] + shift) == pytest.approx(np.linalg.norm(shift))


def test_the_order_of_the_samples_does_not_matter(sets, rng):
    a, b = sets
    assert earth_movers_distance(rng.permutation(a), rng.permutation(b)) == pytest.approx(earth_movers_distance(a, b))
    assert earth_movers_distance(a, rng.permutation(a)) == pytest.approx(0.0, abs=1e-12)


def test_the_distance_is_symmetric_and_keeps_the_triangle_inequality(sets, rng):
    (a, b), c = sets, rng.normal(size=(40, 5))
    assert earth_movers_distance(a, b) == pytest.approx(earth_movers_distance(b, a))
    assert earth_movers_distance(a, b) <= earth_movers_distance(a, c) + earth_movers_distance(c, b)


def test_the_distance_is_never_above_the_cost_of_pairs_in_time(rng):
    for _ in range(20):
        a, b = rng.normal(size=(2, 30, 3))
        assert earth_movers_distance(a, b) <= np.linalg.norm(a - b, axis=1).mean() + 1e-12
    time_ = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    circle = np.stack([np.cos(time_), np.sin(time_)], axis=-1)
    late = np.roll(circle, 6, axis=0)
    assert earth_movers_distance(circle, late) == pytest.approx(0.0, abs=1e-12), "late, but the same states"
    assert np.linalg.norm(circle - late, axis=1).mean() > 0.6


def test_no_permutation_is_cheaper(rng):
    a, b = rng.normal(size=(2, 6, 3))
    cost = cdist(a, b)
    best = min(cost[range(6), list(order)].mean() for order in itertools.permutations(range(6)))
    assert earth_movers_distance(a, b) == pytest.approx(best)


def test_no_transport_plan_with_fractions_is_cheaper(rng):
    """Solved as a linear programme over all plans."""
    a, b = rng.normal(size=(2, 12, 3))
    cost = cdist(a, b)
    rows, columns = np.kron(np.eye(12), np.ones(12)), np.kron(np.ones(12), np.eye(12))
    plan = linprog(cost.ravel(), A_eq=np.vstack([rows, columns]), b_eq=np.full(24, 1.0 / 12.0))
    assert earth_movers_distance(a, b) == pytest.approx(plan.fun)


def test_each_trajectory_is_compared_with_its_own_reference_without_padding(noise):
    states, reference = noise(4), noise(4)
    expected = [earth_movers_distance(states[i, :n], reference[i, :n]) for i, n in enumerate((12, 7, 12))]
    np.testing.assert_allclose(distance_per_trajectory(states, reference), expected)


def test_large_sets_are_thinned_out_evenly_and_always_in_the_same_way(noise):
    states, reference = noise(4), noise(4)
    np.testing.assert_array_equal(evenly_spaced(12, 4), [0, 4, 7, 11])
    np.testing.assert_array_equal(evenly_spaced(12, 100), np.arange(12))
    chosen = [0, 4, 7, 11]
    first = distance_per_trajectory(states, reference, most=4)
    assert first[0] == pytest.approx(earth_movers_distance(states[0, chosen], reference[0, chosen]))
    np.testing.assert_array_equal(first, distance_per_trajectory(states, reference, most=4))


def test_a_trajectory_of_nan_has_no_distance():
    assert np.isnan(distance_per_trajectory(np.full((1, 3, 2), np.nan), np.zeros((1, 3, 2)))).all()


def body_rows(rng, rows=15):
    """Rows of a robot in random poses, its reference in others."""
    names = {"root_position": 3, "root_orientation": 4, "joint_position": 12}
    result = {}
    for prefix, (name, size) in itertools.product(("", "reference_"), names.items()):
        result[prefix + name] = rng.normal(size=(2, rows, size))
    for prefix in ("", "reference_"):
        result[f"{prefix}root_orientation"] /= np.linalg.norm(
            result[f"{prefix}root_orientation"], axis=-1, keepdims=True
        )
    return result


def test_joint_distance_of_an_offset_is_its_root_mean_square(rng):
    rows = body_rows(rng)
    rows["joint_position"] = rows["reference_joint_position"] + 0.1
    np.testing.assert_allclose(joint_distance(rows), 0.1)


def test_body_distance_is_zero_for_the_same_states_in_another_order(rng):
    rows = body_rows(rng)
    for name in ("root_position", "root_orientation", "joint_position"):
        rows[name] = rows[f"reference_{name}"][:, ::-1]
    np.testing.assert_allclose(body_distance(rows, GO2), 0.0, atol=1e-12)


def test_body_distance_of_a_robot_that_is_higher_is_the_height(rng):
    rows = body_rows(rng)
    for name in ("root_orientation", "joint_position"):
        rows[name] = rows[f"reference_{name}"]
    rows["reference_root_position"][..., 2] = 0.3
    rows["root_position"] = rows["reference_root_position"] + [0.0, 0.0, 0.05]
    np.testing.assert_allclose(body_distance(rows, GO2), 0.05)


def test_place_and_heading_in_the_plane_do_not_count_but_tilt_does(rng):
    links = link_positions(GO2, rng.normal(size=(5, 12)))
    position = np.array([1.0, 2.0, 0.3])

    def states(shift, turn, tilt):
        quaternion = Rotation.from_euler("ZX", [turn, tilt]).as_quat()[[3, 0, 1, 2]]
        return body_states(np.tile(position + shift, (5, 1)), np.tile(quaternion, (5, 1)), links)

    here = states([0.0, 0.0, 0.0], 0.0, 0.1)
    np.testing.assert_allclose(states([5.0, -3.0, 0.0], 2.0, 0.1), here, atol=1e-12)
    assert np.abs(states([0.0, 0.0, 0.0], 0.0, 0.2) - here).max() > 1e-3


def test_twenty_trajectories_of_the_papers_length_take_seconds(rng):
    states, reference = rng.normal(size=(2, 20, 571, 12))
    start = time.process_time()
    distance_per_trajectory(states, reference)
    assert time.process_time() - start < 3.0
