"""The robot's figures against those published for the Go2, and its own symmetry."""

from xml.etree import ElementTree

import numpy as np
import pytest

from kine2go_warp.robots import GO2
from kine2go_warp.robots.urdf import UrdfReader

URDF = ElementTree.parse(GO2.urdf).getroot()


def numbers(text):
    return np.array([float(value) for value in text.split()])


def links():
    for link in URDF.findall("link"):
        inertial = link.find("inertial")
        assert inertial is not None, link.attrib["name"]
        inertia = {key: float(value) for key, value in inertial.find("inertia").attrib.items()}
        matrix = np.array(
            [
                [inertia["ixx"], inertia["ixy"], inertia["ixz"]],
                [inertia["ixy"], inertia["iyy"], inertia["iyz"]],
                [inertia["ixz"], inertia["iyz"], inertia["izz"]],
            ]
        )
        mass = float(inertial.find("mass").attrib["value"])
        yield link.attrib["name"], mass, numbers(inertial.find("origin").attrib["xyz"]), matrix


def test_masses_are_those_of_the_go2():
    masses = {name: mass for name, mass, _, _ in links()}
    parts = {"hip": 0.678, "thigh": 1.152, "calf": 0.154, "foot": 0.04}
    for leg in ("FL", "FR", "RL", "RR"):
        for part, mass in parts.items():
            assert masses[f"{leg}_{part}"] == mass
    # The manufacturer's 15.019 kg count two more parts of the head, of 1 g each.
    assert sum(masses.values()) == pytest.approx(15.019, abs=0.0025)
    assert GO2.mass == pytest.approx(sum(masses.values()))


def test_every_inertia_is_that_of_a_real_body():
    for name, _, _, matrix in links():
        a, b, c = np.linalg.eigvalsh(matrix)
        assert a > 0.0, name
        assert a + b >= c * (1.0 - 1e-9), f"{name} breaks the triangle inequality"


@pytest.mark.parametrize(("leg", "mirror"), [("FR", (1, -1, 1)), ("RL", (-1, 1, 1)), ("RR", (-1, -1, 1))], ids=str)
def test_the_hips_of_the_other_legs_mirror_the_front_left_one(leg, mirror):
    found = {name: (com, matrix) for name, _, com, matrix in links()}
    flip = np.diag(mirror)
    com, matrix = found["FL_hip"]
    np.testing.assert_allclose(found[f"{leg}_hip"][0], flip @ com)
    np.testing.assert_allclose(found[f"{leg}_hip"][1], flip @ matrix @ flip)


@pytest.mark.parametrize("part", ["thigh", "calf"])
@pytest.mark.parametrize("leg", ["FR", "RL", "RR"])
def test_thighs_and_calves_mirror_sideways_only(leg, part):
    found = {name: (com, matrix) for name, _, com, matrix in links()}
    flip = np.diag([1, -1 if leg.endswith("R") else 1, 1])
    com, matrix = found[f"FL_{part}"]
    np.testing.assert_allclose(found[f"{leg}_{part}"][0], flip @ com)
    np.testing.assert_allclose(found[f"{leg}_{part}"][1], flip @ matrix @ flip)


def test_limits_and_orders():
    assert GO2.joint_names[:3] == ("FL_hip_joint", "FL_thigh_joint", "FL_calf_joint")
    assert [name[:2] for name in GO2.joint_names[::3]] == ["FL", "FR", "RL", "RR"]
    assert [name[:2] for name in GO2.sdk_motor_order[::3]] == ["FR", "FL", "RR", "RL"]
    assert sorted(GO2.sdk_motor_order) == sorted(GO2.joint_names)
    np.testing.assert_allclose(GO2.joint_effort, (23.7, 23.7, 35.55) * 4)
    np.testing.assert_allclose(GO2.joint_speed, (30.1, 30.1, 20.07) * 4)
    np.testing.assert_allclose(GO2.joint_lower, (-1.0472, -1.5708, -2.7227) * 2 + (-1.0472, -0.5236, -2.7227) * 2)
    np.testing.assert_allclose(GO2.joint_upper, (1.0472, 3.4907, -0.83776) * 2 + (1.0472, 4.5379, -0.83776) * 2)
    assert GO2.foot_radius == 0.022
    assert GO2.link_names == tuple(name[:-6] for name in GO2.joint_names) + GO2.foot_links


def test_standing_pose_is_within_limits_and_stands():
    from kine2go_warp.robots.kinematics import foot_positions

    pose = np.array(GO2.default_joint_position)
    assert np.all((pose > GO2.joint_lower) & (pose < GO2.joint_upper))
    heights = foot_positions(GO2, pose)[:, 2]
    assert GO2.default_root_height == pytest.approx(GO2.foot_radius - heights.min(), abs=0.03)
    assert GO2.default_root_height > GO2.foot_radius - heights.min(), "no foot inside the floor"


def test_a_urdf_without_a_joint_is_named():
    from kine2go_warp.errors import Kine2GoError

    with pytest.raises(Kine2GoError, match="tail_joint"):
        UrdfReader(GO2.urdf).joint_offset("tail_joint")
