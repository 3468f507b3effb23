"""Robot and reference stand where they are put, checked against the closed-form kinematics."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kine2go_warp.errors import RenderError
from kine2go_warp.renders.camera import Pose
from kine2go_warp.renders.scene import Scene
from kine2go_warp.robots import GO2
from kine2go_warp.robots.kinematics import foot_positions, link_positions, link_rotations
from kine2go_warp.robots.look import link_surfaces


@pytest.fixture(scope="module")
def scene():
    return Scene(GO2)


def random_pose(rng):
    turn = Rotation.random(random_state=rng)
    joints = rng.uniform(GO2.joint_lower, GO2.joint_upper)
    return Pose(rng.normal(size=3), turn.as_quat()[[3, 0, 1, 2]], joints), turn


def feet(scene, name):
    return np.array([scene.data.geom(f"{name}/{foot}_0").xpos for foot in GO2.foot_links])


def test_feet_are_where_kinematics_says_they_are(scene, rng):
    (robot, turn), (reference, other) = random_pose(rng), random_pose(rng)
    scene.place(robot, reference)
    for name, pose, rotation in (("robot", robot, turn), ("reference", reference, other)):
        expected = rotation.apply(foot_positions(GO2, pose.joint_position)) + pose.root_position
        np.testing.assert_allclose(feet(scene, name), expected, atol=1e-6)


def test_all_that_is_to_be_seen_is_there_once_for_each_of_the_two(scene):
    assert scene.model.ngeom == 2 * sum(map(len, link_surfaces(GO2).values())) + 1


def test_the_reference_is_see_through_and_the_robot_is_not(scene):
    names = [scene.model.geom(index).name for index in range(scene.model.ngeom)]
    opacity = dict(zip(names, scene.model.geom_rgba[:, 3], strict=True))
    assert all((value < 0.5) == name.startswith("reference/") for name, value in opacity.items())


def test_every_vertex_is_drawn_where_its_link_is(scene, rng):
    """MuJoCo moves a mesh into its own frame of inertia; the corners come out at the link's pose all the same."""
    robot, turn = random_pose(rng)
    scene.place(robot)
    for leg, thigh in enumerate(GO2.leg_links[1::3]):
        (surface, *_) = link_surfaces(GO2)[thigh]
        geom = scene.data.geom(f"robot/{thigh}_0")
        mesh = scene.model.mesh(f"robot/{thigh}_0")
        first = int(mesh.vertadr[0])
        corners = scene.model.mesh_vert[first : first + int(mesh.vertnum[0])] @ geom.xmat.reshape(3, 3).T + geom.xpos
        frame = link_rotations(GO2, robot.joint_position)[3 * leg + 1]
        centre = link_positions(GO2, robot.joint_position)[3 * leg + 1]
        expected = turn.apply(surface.vertices @ frame.T + centre) + robot.root_position
        distance = np.linalg.norm(corners[:, None] - expected[None], axis=-1)
        assert max(distance.min(axis=0).max(), distance.min(axis=1).max()) < 1e-5


TETRAHEDRON = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 -0.2\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


def test_meshes_of_ones_own_take_the_place_of_trunk_and_legs(tmp_path):
    for name in ("base.obj", "hip.obj", "thigh.obj", "thigh_mirror.obj", "calf.obj"):
        (tmp_path / name).write_text(TETRAHEDRON)
    model = Scene(GO2, tmp_path).model
    names = {model.geom(index).name for index in range(model.ngeom)}
    shown = {name.removeprefix("robot/") for name in names if name.startswith("robot/")}
    assert {"base_trunk", "FL_hip_hip", "FL_thigh_thigh", "FR_thigh_thigh_mirror", "RR_calf_calf", "RL_foot_0"} <= shown
    assert len(shown) == 13 + 4, "one for each link, and our own feet"
    # The hip of the front right leg is the left one's, turned about x by half a turn.
    turned = Rotation.from_quat(model.geom("robot/FR_hip_hip").quat, scalar_first=True)
    plain = Rotation.from_quat(model.geom("robot/FL_hip_hip").quat, scalar_first=True)
    np.testing.assert_allclose((turned * plain.inv()).as_matrix(), np.diag([1, -1, -1]), atol=1e-6)


def test_a_folder_without_a_mesh_or_with_a_broken_one_is_one_line(tmp_path):
    for name in ("trunk.obj", "hip.obj", "thigh.obj"):
        (tmp_path / name).write_text(TETRAHEDRON)
    with pytest.raises(RenderError, match=r"no mesh of calf; expected .* of kind \.obj, \.stl$"):
        Scene(GO2, tmp_path)
    (tmp_path / "calf.obj").write_text("no mesh at all")
    with pytest.raises(RenderError, match=r"a mesh cannot be read \([^\n]*\)$"):
        Scene(GO2, tmp_path)
