"""The robots of the package: figures against those published, URDF against specification, and their own symmetry."""

from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kine2go_warp.env.mujoco_engine import MujocoRobot
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.learning.presets import FAST
from kine2go_warp.robots import GO2, ROBOTS, robot_named
from kine2go_warp.robots.check import check_robot
from kine2go_warp.robots.compiled import robot_tree
from kine2go_warp.robots.kinematics import foot_positions
from kine2go_warp.robots.urdf import UrdfReader, read_inertia
from tests.robots.second_source import BODIES, LENGTHS, RANGES, TORQUES, WEIGHTS

every_robot = pytest.mark.parametrize("spec", [robot_named(name) for name in ROBOTS], ids=list(ROBOTS))
"""The test is made for each robot of the package."""


def links(spec):
    """Mass [kg], centre of mass [m] and inertia [kg m^2] of each link of a URDF, by name."""
    found = {link.attrib["name"]: read_inertia(link) for link in ElementTree.parse(spec.urdf).iter("link")}
    assert all(mass > 0.0 for mass, _, _ in found.values())
    return found


def test_masses_are_those_of_the_go2():
    masses = {name: mass for name, (mass, _, _) in links(GO2).items()}
    parts = {"hip": 0.678, "thigh": 1.152, "calf": 0.154, "foot": 0.04}
    for leg in ("FL", "FR", "RL", "RR"):
        for part, mass in parts.items():
            assert masses[f"{leg}_{part}"] == mass
    # The manufacturer's 15.019 kg count two more parts of the head, of 1 g each.
    assert sum(masses.values()) == pytest.approx(15.019, abs=0.0025)
    assert GO2.mass == pytest.approx(sum(masses.values()))


@every_robot
def test_a_robot_weighs_about_what_its_data_sheet_says(spec):
    assert -0.01 < spec.mass / WEIGHTS[spec.name] - 1.0 < (0.25 if spec.name == "b2" else 0.1)


@pytest.mark.parametrize(("robot", "link"), [(robot, link) for robot, found in BODIES.items() for link in found])
def test_the_compiled_bodies_are_those_of_a_second_source(robot, link):
    """MuJoCo compiles our URDF; mass, centre of mass and the whole inertia agree with another model's numbers."""
    model, expected = robot_tree(robot_named(robot)).compile(), BODIES[robot][link]
    body = model.body(link)
    turn = Rotation.from_quat(body.iquat, scalar_first=True).as_matrix()
    theirs = Rotation.from_quat(expected.turn, scalar_first=True).as_matrix()
    assert body.mass[0] == pytest.approx(expected.mass, rel=expected.tolerance)
    np.testing.assert_allclose(body.ipos, expected.centre, atol=0.1 * expected.tolerance)
    np.testing.assert_allclose(
        turn @ np.diag(body.inertia) @ turn.T,
        theirs @ np.diag(expected.moments) @ theirs.T,
        atol=expected.tolerance * max(expected.moments),
    )


def test_the_base_of_the_go1_holds_the_rotors_of_its_hips():
    """Menagerie's trunk has 5.204 kg: it leaves out four rotors of 0.089 kg, which the maker's URDF fixes to it."""
    assert links(robot_named("go1"))["base"][0] == pytest.approx(5.204 + 4 * 0.089)


@pytest.mark.parametrize("name", LENGTHS)
def test_lengths_limits_and_torques_are_those_of_a_second_source(name):
    spec = robot_named(name)
    (x, y), beside, thigh, calf = LENGTHS[name]
    for leg in spec.legs:
        front, side = 1.0 if leg.name[0] == "F" else -1.0, 1.0 if leg.name[1] == "L" else -1.0
        assert leg.hip_offset == pytest.approx((front * x, side * y, 0.0))
        assert leg.thigh_offset == pytest.approx((0.0, side * beside, 0.0))
        assert (leg.thigh_length, leg.calf_length) == pytest.approx((thigh, calf))
    lower, upper = np.transpose(RANGES[name])
    np.testing.assert_allclose(spec.joint_lower, np.tile(lower, 4), atol=1e-5)
    np.testing.assert_allclose(spec.joint_upper, np.tile(upper, 4), atol=1e-5)
    np.testing.assert_allclose(spec.joint_effort, np.tile(TORQUES[name], 4), rtol=0.07 if name == "b2" else 0.0)


@every_robot
def test_the_urdf_is_a_robot_of_this_kind(spec):
    check_robot(spec, spec.name)


@every_robot
def test_every_inertia_is_that_of_a_real_body(spec):
    for name, (_, _, matrix) in links(spec).items():
        a, b, c = np.linalg.eigvalsh(matrix)
        assert a > 0.0, name
        assert a + b >= c * (1.0 - 1e-9), f"{name} breaks the triangle inequality"


@every_robot
@pytest.mark.parametrize("part", ["hip", "thigh", "calf"])
@pytest.mark.parametrize("leg", ["FR", "RL", "RR"])
def test_the_other_legs_mirror_the_front_left_one(spec, leg, part):
    """Hips lengthwise, too; the Go1 has the same calf on both sides."""
    found = links(spec)
    flip = np.diag([-1.0 if part == "hip" and leg[0] == "R" else 1.0, -1.0 if leg[1] == "R" else 1.0, 1.0])
    if (spec.name, part) == ("go1", "calf"):
        flip = np.eye(3)
    _, centre, matrix = found[f"FL_{part}"]
    np.testing.assert_allclose(found[f"{leg}_{part}"][1], flip @ centre)
    np.testing.assert_allclose(found[f"{leg}_{part}"][2], flip @ matrix @ flip)


@every_robot
def test_joints_and_motors_are_in_the_orders_of_package_and_sdk(spec):
    assert spec.joint_names[:3] == ("FL_hip_joint", "FL_thigh_joint", "FL_calf_joint")
    assert [name[:2] for name in spec.joint_names[::3]] == ["FL", "FR", "RL", "RR"]
    assert [name[:2] for name in spec.sdk_motor_order[::3]] == ["FR", "FL", "RR", "RL"]
    assert sorted(spec.sdk_motor_order) == sorted(spec.joint_names)
    assert spec.link_names == tuple(name[:-6] for name in spec.joint_names) + spec.foot_links


def test_limits_of_the_go2():
    np.testing.assert_allclose(GO2.joint_effort, (23.7, 23.7, 35.55) * 4)
    np.testing.assert_allclose(GO2.joint_speed, (30.1, 30.1, 20.07) * 4)
    np.testing.assert_allclose(GO2.joint_lower, (-1.0472, -1.5708, -2.7227) * 2 + (-1.0472, -0.5236, -2.7227) * 2)
    np.testing.assert_allclose(GO2.joint_upper, (1.0472, 3.4907, -0.83776) * 2 + (1.0472, 4.5379, -0.83776) * 2)
    assert GO2.foot_radius == 0.022


@every_robot
def test_motors_give_no_more_than_the_urdf_allows_and_end_at_its_speed(spec):
    """The curve of the Go2's motors is known; the others' have its shape."""
    limits = spec.motor_limits
    assert np.all(np.array(limits.driving) <= np.array(limits.braking))
    assert np.all(np.array(limits.braking) < np.array(spec.joint_effort))
    np.testing.assert_allclose(limits.no_load_speed, spec.joint_speed, rtol=0.03)
    np.testing.assert_allclose(np.divide(limits.full_torque_speed, limits.no_load_speed), 13.5 / 30.0)
    assert limits.driving[2] / limits.driving[0] == pytest.approx(spec.joint_effort[2] / spec.joint_effort[0])


@every_robot
def test_standing_pose_is_within_limits_and_stands(spec):
    pose = np.array(spec.default_joint_position)
    assert np.all((pose > spec.joint_lower) & (pose < spec.joint_upper))
    heights = foot_positions(spec, pose)[:, 2]
    assert spec.default_root_height == pytest.approx(spec.foot_radius - heights.min(), abs=0.03)
    assert spec.default_root_height > spec.foot_radius - heights.min(), "no foot inside the floor"


@every_robot
def test_the_robot_stands_with_the_gains_of_the_preset(spec):
    """Two seconds in plain MuJoCo with the default pose as target: level, at rest, as high as the pose says."""
    robot = MujocoRobot(FAST.env, spec)
    pose = np.float32(spec.default_joint_position)
    robot.set_state(np.concatenate([[0, 0, spec.default_root_height, 0, 0, 0, 1], pose]), np.zeros(18))
    for _ in range(120):
        robot.step(pose)
    joint_q, joint_qd = robot.state()
    assert 0.9 < joint_q[2] / spec.default_root_height <= 1.0
    assert np.abs(joint_q[3:6]).max() < 0.05
    assert np.abs(joint_q[7:] - pose).max() < 0.15
    assert np.abs(joint_qd).max() < 0.05
    assert np.all(np.abs(robot.torque) < 0.6 * np.array(spec.joint_effort))


def test_the_gains_of_a_preset_are_the_robots_times_its_factors():
    stiffness, damping = FAST.env.motor.gains(robot_named("b2"))
    assert (stiffness, damping) == pytest.approx((6.4 * 60.0, 10.0 * 2.0))
    assert FAST.env.motor.gains(GO2) == (60.0, 2.0)


def test_a_urdf_without_a_joint_is_named():
    with pytest.raises(Kine2GoError, match="tail_joint"):
        UrdfReader(GO2.urdf).joint_offset("tail_joint")
