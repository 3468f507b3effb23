from dataclasses import replace

import numpy as np
import pytest

from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.terms.base import find_term
from kine2go_warp.env.terms.randomization import RandomizationTerm, randomized
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.quantities import RANDOMIZED_PARAMETERS
from kine2go_warp.robots import GO2
from tests.env.helpers import EVERYTHING, STILL, drive


@pytest.fixture(scope="module")
def drawn_environment(clip, small_config):
    return ImitationEnvironment([clip], replace(small_config, num_worlds=64, randomization=EVERYTHING), "cpu")


def test_everything_is_drawn_within_its_range_and_recorded(drawn_environment):
    drawn = drawn_environment.randomization.parameters()
    assert set(drawn) == {parameter.name for parameter in RANDOMIZED_PARAMETERS}
    motor = drawn_environment.config.motor
    nominal = {"stiffness": motor.stiffness, "damping": motor.damping}
    drawn = drawn | {"joint_friction": drawn["joint_friction"] / motor.joint_friction(GO2)}
    for name, values in drawn.items():
        low, high = (limit * nominal.get(name, 1.0) for limit in find_term(EVERYTHING, name).range)
        half_substep = 0.5 / 240.0 if name == "latency" else 1e-5
        assert low - half_substep <= values.min(), name
        assert values.max() <= high + half_substep, name
        assert np.ptp(values) > 0.5 * (high - low), f"{name} must use its range"
    assert len(np.unique(drawn["stiffness"])) == 64 * 12, "each joint has its own"
    assert set(np.round(drawn["latency"] * 240.0)) == set(range(8)), "0 to 0.03 s are 0 to 7 substeps"


def test_what_is_drawn_reaches_the_solver(drawn_environment):
    simulation, drawn = drawn_environment.simulation, drawn_environment.randomization.parameters()
    solver = simulation.solver.mjw_model
    mass = solver.body_mass.numpy()[:, 1]
    np.testing.assert_allclose(
        mass, drawn_environment.randomization.bodies.base.nominal_mass + drawn["base_mass"], rtol=1e-5
    )
    np.testing.assert_allclose(solver.body_ipos.numpy()[:, 1], simulation.robot.com_b.numpy(), atol=1e-6)
    inertia = solver.body_inertia.numpy()[:, 1].sum(axis=1)
    np.testing.assert_allclose(inertia / inertia[0], mass / mass[0], rtol=1e-4)
    friction, roles = solver.geom_friction.numpy()[:, :, 0], simulation.geom_role.numpy()
    np.testing.assert_array_equal(friction[:, roles >= 0], np.tile(drawn["friction"][:, None], (1, (roles >= 0).sum())))
    assert friction[:, roles < 0].max() < 0.01, "the ground's own friction stays out of the way"


def test_an_empty_range_leaves_everything_as_it_is(clip, small_config):
    drawn = ImitationEnvironment([clip], small_config, "cpu").randomization.parameters()
    for name, value in (("base_mass", 0.0), ("base_com", 0.0), ("strength", 1.0), ("motor_offset", 0.0)):
        np.testing.assert_array_equal(drawn[name], np.full_like(drawn[name], value))
    np.testing.assert_allclose(drawn["stiffness"], small_config.motor.stiffness)
    np.testing.assert_allclose(drawn["latency"], 5 / 240.0)


def test_a_range_of_one_value_gives_the_same_bits_as_none(clip, small_config):
    fixed = randomized(
        friction=(0.8, 0.8), stiffness=(1.0, 1.0), damping=(1.0, 1.0), strength=(1.0, 1.0), motor_offset=(0.0, 0.0)
    )
    plain = drive(ImitationEnvironment([clip], small_config, "cpu"), 30, 2)[-1]
    other = drive(ImitationEnvironment([clip], replace(small_config, randomization=fixed), "cpu"), 30, 2)[-1]
    for name, values in plain.items():
        assert values.tobytes() == other[name].tobytes(), name


def test_heavier_robots_press_harder_on_the_ground(standing_clip, small_config):
    heavier = randomized(base_mass=(2.0, 6.0))
    config = replace(small_config, reset=STILL, randomization=heavier)
    environment = ImitationEnvironment([standing_clip], config, "cpu")
    for _ in range(120):
        environment.step()
    weight = environment.simulation.robot_weight + 9.81 * environment.randomization.parameters()["base_mass"]
    np.testing.assert_allclose(environment.simulation.foot_force.numpy()[..., 2].sum(axis=1), weight, rtol=0.01)


def test_pushes_come_in_their_interval_with_their_speed_and_move_the_robot(standing_clip, small_config):
    pushes = randomized(push_interval=(0.25, 0.5), push_speed=(0.3, 0.6))
    config = replace(small_config, num_worlds=32, reset=STILL, randomization=pushes, episode_time=100.0)
    environment = ImitationEnvironment([standing_clip], config, "cpu")
    seen, gained = [], []
    for _ in range(120):
        before = environment.robot.joint_qd.numpy()[:, :2].copy()
        environment.step()
        seen.append(environment.randomization.push.numpy()[:, :2].copy())
        gained.append(environment.robot.joint_qd.numpy()[:, :2] - before)
    push, done = np.array(seen), np.linalg.norm(seen, axis=-1) > 0.0
    speed = np.linalg.norm(push[done], axis=-1)
    assert speed.min() >= 0.3
    assert speed.max() <= 0.6
    assert np.ptp(np.arctan2(push[done][:, 1], push[done][:, 0])) > 5.0, "from all sides"
    intervals = np.concatenate([np.diff(np.flatnonzero(done[:, world])) for world in range(32)])
    assert intervals.min() >= 15
    assert intervals.max() <= 30 + 1
    along = np.sum(np.array(gained)[done] * push[done], axis=-1) / speed**2
    assert np.median(along) > 0.5, "most of a push is still there after a control step"


@pytest.mark.parametrize(
    "ranges",
    [
        {"friction": (1.0,)},
        {"friction": (1.0, 0.5)},
        {"friction": (-0.1, 0.5)},
        {"latency": (-0.1, 0.0)},
        {"push_interval": (1.0, 2.0)},
    ],
)
def test_impossible_ranges_are_refused(ranges):
    with pytest.raises(Kine2GoError, match=next(iter(ranges))):
        randomized(**ranges)


def test_terms_of_one_parameter_are_applied_one_after_the_other(clip, small_config):
    plain = ImitationEnvironment([clip], replace(small_config, randomization=randomized(strength=(0.5, 1.0))), "cpu")
    halved = RandomizationTerm("halved", (0.5, 0.5), parameter="strength")
    terms = (*plain.config.randomization, halved)
    both = ImitationEnvironment([clip], replace(small_config, randomization=terms), "cpu")
    expected = 0.5 * plain.randomization.parameters()["strength"]
    np.testing.assert_array_equal(both.randomization.parameters()["strength"], expected)


def test_terms_of_other_names_draw_other_numbers(clip, small_config):
    names = ("one", "other")
    terms = [RandomizationTerm(name, (0.5, 1.0), parameter="friction") for name in names]
    drawn = [
        ImitationEnvironment([clip], replace(small_config, randomization=(term,)), "cpu").randomization.parameters()
        for term in terms
    ]
    assert not np.any(drawn[0]["friction"] == drawn[1]["friction"])


def test_an_unknown_parameter_is_named_with_those_that_can_be_drawn():
    with pytest.raises(Kine2GoError, match="slack draws an unknown parameter 'armature'; known are: base_mass"):
        RandomizationTerm("slack", (0.0, 1.0), parameter="armature")
