"""Robot and reference stand where they are put, checked against the closed-form kinematics."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kine2go_warp.renders.camera import Pose
from kine2go_warp.renders.scene import Scene
from kine2go_warp.robots import GO2
from kine2go_warp.robots.kinematics import foot_positions


@pytest.fixture(scope="module")
def scene():
    return Scene(GO2)


def random_pose(rng):
    turn = Rotation.random(random_state=rng)
    joints = rng.uniform(GO2.joint_lower, GO2.joint_upper)
    return Pose(rng.normal(size=3), turn.as_quat()[[3, 0, 1, 2]], joints), turn


def feet(scene, name):
    return np.array([scene.data.geom(f"{name}/{foot}_sphere_visual").xpos for foot in GO2.foot_links])


def test_feet_are_where_kinematics_says_they_are(scene, rng):
    (robot, turn), (reference, other) = random_pose(rng), random_pose(rng)
    scene.place(robot, reference)
    for name, pose, rotation in (("robot", robot, turn), ("reference", reference, other)):
        expected = rotation.apply(foot_positions(GO2, pose.joint_position)) + pose.root_position
        np.testing.assert_allclose(feet(scene, name), expected, atol=1e-6)


def test_all_that_is_to_be_seen_is_there_once_for_each_of_the_two(scene):
    assert scene.model.ngeom == 2 * GO2.urdf.read_text().count("<visual ") + 1


def test_the_reference_is_see_through_and_the_robot_is_not(scene):
    names = [scene.model.geom(index).name for index in range(scene.model.ngeom)]
    opacity = dict(zip(names, scene.model.geom_rgba[:, 3], strict=True))
    assert all((value < 0.5) == name.startswith("reference/") for name, value in opacity.items())


def test_capsules_are_as_long_as_the_cylinders_of_the_model(scene):
    radius, half_length, _ = scene.model.geom("robot/FL_thigh_capsule_visual").size
    assert 2.0 * (radius + half_length) == pytest.approx(0.253)
