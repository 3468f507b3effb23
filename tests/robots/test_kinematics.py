import numpy as np
import placo

from kine2go_warp.robots import GO2
from kine2go_warp.robots.kinematics import foot_positions, leg_points, link_positions


def test_closed_form_agrees_with_placo(rng):
    robot = placo.RobotWrapper(str(GO2.urdf), placo.Flags.ignore_collisions)
    robot.set_T_world_fbase(np.eye(4))
    for pose in rng.uniform(GO2.joint_lower, GO2.joint_upper, (50, 12)):
        for name, value in zip(GO2.joint_names, pose, strict=True):
            robot.set_joint(name, value)
        robot.update_kinematics()
        expected = [robot.get_T_world_frame(link)[:3, 3] for link in GO2.link_names]
        np.testing.assert_allclose(link_positions(GO2, pose), expected, atol=1e-12)


def test_shapes_follow_the_leading_dimensions(rng):
    poses = rng.uniform(GO2.joint_lower, GO2.joint_upper, (3, 5, 12))
    assert leg_points(GO2, poses).shape == (3, 5, 4, 4, 3)
    assert link_positions(GO2, poses).shape == (3, 5, 16, 3)
    np.testing.assert_array_equal(foot_positions(GO2, poses)[1, 2], foot_positions(GO2, poses[1, 2]))
