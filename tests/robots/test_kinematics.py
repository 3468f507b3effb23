import numpy as np
import placo
from scipy.spatial.transform import Rotation

from kine2go_warp.metrics import foot_slip
from kine2go_warp.robots import GO2
from kine2go_warp.robots.kinematics import (
    contact_velocities,
    foot_positions,
    leg_points,
    link_positions,
    link_rotations,
    link_turning,
)
from kine2go_warp.rotations import from_rotation


def test_closed_form_agrees_with_placo(rng):
    robot = placo.RobotWrapper(str(GO2.urdf), placo.Flags.ignore_collisions)
    robot.set_T_world_fbase(np.eye(4))
    for pose in rng.uniform(GO2.joint_lower, GO2.joint_upper, (50, 12)):
        for name, value in zip(GO2.joint_names, pose, strict=True):
            robot.set_joint(name, value)
        robot.update_kinematics()
        expected = [robot.get_T_world_frame(link)[:3, 3] for link in GO2.link_names]
        np.testing.assert_allclose(link_positions(GO2, pose), expected, atol=1e-12)


def test_links_turn_as_those_of_placo(rng):
    """Orientations against placo's frames, angular velocities against their differences."""
    step = 1e-6
    robot = placo.RobotWrapper(str(GO2.urdf), placo.Flags.ignore_collisions)
    robot.set_T_world_fbase(np.eye(4))

    def turned(joints):
        for name, value in zip(GO2.joint_names, joints, strict=True):
            robot.set_joint(name, value)
        robot.update_kinematics()
        return np.array([robot.get_T_world_frame(link)[:3, :3] for link in GO2.link_names])

    for joints in rng.uniform(GO2.joint_lower, GO2.joint_upper, (20, 12)):
        rates = rng.normal(scale=5.0, size=12)
        np.testing.assert_allclose(link_rotations(GO2, joints), turned(joints), atol=1e-12)
        before, after = turned(joints - step * rates), turned(joints + step * rates)
        expected = Rotation.from_matrix(after @ before.transpose(0, 2, 1)).as_rotvec() / (2.0 * step)
        np.testing.assert_allclose(link_turning(GO2, joints, rates), expected, atol=1e-6)


def test_shapes_follow_the_leading_dimensions(rng):
    poses = rng.uniform(GO2.joint_lower, GO2.joint_upper, (3, 5, 12))
    assert leg_points(GO2, poses).shape == (3, 5, 4, 4, 3)
    assert link_positions(GO2, poses).shape == (3, 5, 16, 3)
    np.testing.assert_array_equal(foot_positions(GO2, poses)[1, 2], foot_positions(GO2, poses[1, 2]))


def placed(position, turn, joints):
    """Frames of the calves in the world by placo, shape [4, 4, 4]."""
    robot = placo.RobotWrapper(str(GO2.urdf), placo.Flags.ignore_collisions)
    base = np.eye(4)
    base[:3, :3], base[:3, 3] = turn.as_matrix(), position
    robot.set_T_world_fbase(base)
    for name, value in zip(GO2.joint_names, joints, strict=True):
        robot.set_joint(name, value)
    robot.update_kinematics()
    return np.array([robot.get_T_world_frame(name) for name in GO2.foot_links])


def test_contact_velocities_are_those_of_points_fixed_to_the_calves(rng):
    """Against finite differences of placo's frames, with a base that moves and turns about every axis."""
    step = 1e-5
    for _ in range(10):
        turn = Rotation.random(rng=rng)
        position, velocity, turning = rng.normal(size=(3, 3))
        joints, rates = rng.uniform(GO2.joint_lower, GO2.joint_upper), rng.normal(scale=5.0, size=12)
        before, now, after = (
            placed(position + time * velocity, Rotation.from_rotvec(time * turning) * turn, joints + time * rates)
            for time in (-step, 0.0, step)
        )
        lowest = np.linalg.inv(now) @ [0.0, 0.0, -GO2.foot_radius, 0.0] + [0.0, 0.0, 0.0, 1.0]
        expected = ((after - before) @ lowest[..., None])[:, :3, 0] / (2.0 * step)
        feet = (after - before)[:, :3, 3] / (2.0 * step)
        rows = {
            "root_orientation": from_rotation(turn),
            "root_angular_velocity": turning,
            "joint_position": joints,
            "joint_velocity": rates,
            "link_linear_velocity": np.concatenate([np.full((12, 3), np.nan), feet]),
        }
        np.testing.assert_allclose(contact_velocities(GO2, rows), expected, atol=1e-6)


def test_a_calf_that_turns_over_a_standing_foot_does_not_slip():
    """A sphere that rolls without slipping at 3 rad/s goes forward at 3 rad/s times its radius."""
    rate, rows = 3.0, 10
    joints = np.zeros((1, rows, 12))
    joints[..., 2::3] = rate
    links = np.zeros((1, rows, 16, 3))
    links[..., 12:, 0] = rate * GO2.foot_radius
    standing = {
        "root_orientation": np.tile([1.0, 0.0, 0.0, 0.0], (1, rows, 1)),
        "root_angular_velocity": np.zeros((1, rows, 3)),
        "joint_position": np.tile(GO2.default_joint_position, (1, rows, 1)),
        "joint_velocity": joints,
        "link_linear_velocity": links,
    }
    force = np.tile([0.0, 0.0, 40.0], (1, rows, 4, 1))
    assert foot_slip(contact_velocities(GO2, standing), force) < 1e-12
    np.testing.assert_allclose(foot_slip(links[:, :, 12:], force), rate * GO2.foot_radius, err_msg="of the centres")
    backwards = standing | {"joint_velocity": -joints}
    slip = foot_slip(contact_velocities(GO2, backwards), force)
    np.testing.assert_allclose(slip, 2.0 * rate * GO2.foot_radius)
