import time
from dataclasses import replace

import numpy as np
import pytest

from kine2go_warp.motions.poses import Poses
from kine2go_warp.robots import GO2
from kine2go_warp.robots.kinematics import foot_positions
from kine2go_warp.rotations import to_rotation


def targets_of(joints, height=0.3, yaw=0.3):
    count = len(joints)
    root = np.tile([1.0, -2.0, height], (count, 1)) + np.linspace(0.0, 1.0, count)[:, None] * [1.0, 0.2, 0.0]
    orientation = np.tile([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)], (count, 1))
    rotation = to_rotation(orientation).as_matrix()
    feet = np.einsum("tij,tkj->tki", rotation, foot_positions(GO2, joints)) + root[:, None]
    return Poses(root, orientation, feet=feet)


def gait_like(count):
    phase = np.linspace(0.0, 6.0 * np.pi, count)[:, None] + np.linspace(0.0, 2.0, 12)
    return np.array(GO2.default_joint_position) + 0.35 * np.sin(phase)


def test_joints_of_reachable_feet_are_recovered(solver):
    joints = gait_like(200)
    solved, residual = solver.solve(targets_of(joints))
    assert residual.max() < 2e-4
    np.testing.assert_allclose(solved.joints, joints, atol=5e-3)


def test_feet_out_of_reach_leave_a_residual_and_no_broken_limit(solver):
    targets = targets_of(gait_like(30), height=0.3)
    far = targets.feet + np.array([0.0, 0.0, -0.4])
    solved, residual = solver.solve(replace(targets, feet=far))
    assert residual.min() > 0.05
    assert np.all(solved.root_position[:, 2] < targets.root_position[:, 2] - 0.05), "the base gives way"
    assert np.all(solved.joints >= np.array(GO2.joint_lower) - 1e-6)
    assert np.all(solved.joints <= np.array(GO2.joint_upper) + 1e-6)


def test_the_result_does_not_depend_on_what_was_solved_before(solver):
    targets = targets_of(gait_like(20))
    first, _ = solver.solve(targets)
    solver.solve(targets_of(gait_like(20) + 0.2, height=0.25))
    np.testing.assert_array_equal(solver.solve(targets)[0].joints, first.joints)


@pytest.mark.slow
def test_at_least_500_frames_a_second(solver):
    targets = targets_of(gait_like(2000))
    start = time.perf_counter()
    solver.solve(targets)
    assert 2000 / (time.perf_counter() - start) > 500
