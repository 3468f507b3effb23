"""Distances between the legs against MuJoCo's own distances of shapes."""

import mujoco
import numpy as np
import warp as wp

from kine2go_warp.env.model import body_shapes, leg_geometry
from kine2go_warp.kernels.leg_distance import least_leg_distance
from kine2go_warp.kernels.state import RobotState
from kine2go_warp.robots import GO2
from kine2go_warp.robots.compiled import robot_tree

FAR = 1.0


def kernel_distances(joint_position):
    """The kernel's distances for some poses, shape [num_poses]."""
    count = len(joint_position)
    with wp.ScopedDevice(wp.get_device()):
        robot = RobotState()
        coordinates = np.hstack([np.zeros((count, 6)), np.ones((count, 1)), joint_position])
        robot.joint_q = wp.array(np.float32(coordinates), dtype=float)
        robot.joint_qd = wp.zeros((count, 18), dtype=float)
        robot.com_b = wp.zeros(count, dtype=wp.vec3)
        distance = wp.zeros(count, dtype=float)
        inputs = [robot, leg_geometry(GO2, wp.get_device()), body_shapes(GO2), distance]
        wp.launch(least_leg_distance, dim=count, inputs=inputs)
        return distance.numpy()


def mujoco_distances(joint_position):
    """The same by MuJoCo, of all pairs of shapes of different legs, and of legs with trunk and head."""
    model = robot_tree(GO2).compile()
    data, segment = mujoco.MjData(model), np.zeros(6)
    owners = [model.geom(geom).name.split("_")[0] for geom in range(model.ngeom)]
    pairs = [(a, b) for a in range(model.ngeom) for b in range(a) if owners[a] != owners[b]]
    pairs = [pair for pair in pairs if not {owners[shape] for shape in pair} <= {"base", "head"}]
    found = []
    for pose in joint_position:
        data.qpos[:] = np.concatenate([[0, 0, 0, 1, 0, 0, 0], pose])
        mujoco.mj_kinematics(model, data)
        found.append(min(mujoco.mj_geomDistance(model, data, a, b, FAR, segment) for a, b in pairs))
    return np.array(found)


def test_distances_are_mujocos_wherever_the_joints_are(rng):
    poses = rng.uniform(GO2.joint_lower, GO2.joint_upper, (400, 12))
    ours, theirs = kernel_distances(poses), mujoco_distances(poses)
    apart = theirs > 1e-4
    assert 100 < apart.sum() < 390, "poses of both kinds must occur"
    np.testing.assert_allclose(ours[apart], theirs[apart], atol=2e-4)
    assert np.all(ours[theirs < -1e-4] < 0.0), "overlaps must be overlaps"


def test_the_standing_robots_legs_are_apart_and_crossed_ones_overlap():
    standing = np.array(GO2.default_joint_position)
    crossed = standing.copy()
    crossed[[0, 3]] = -0.45, 0.45
    ours, theirs = kernel_distances(np.array([standing, crossed])), mujoco_distances(np.array([standing, crossed]))
    assert ours[0] > 0.05
    assert ours[1] < 0.0
    assert theirs[1] < 0.0
