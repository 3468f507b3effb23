from dataclasses import replace

import numpy as np
import warp as wp

from kine2go_warp.kernels.terminations import REASON_NAMES, terminate
from tests.kernels.oracle import near, random_states, upload_reference, upload_robot

TIGHTENING_STEPS = 100


def reasons(robot, reference, body_contact=None, length=None, joint_q=None, overflow=None, max_distance=1.0, age=None):
    count = len(robot.position)
    state = upload_robot(robot, np.zeros(3))
    if joint_q is not None:
        state.joint_q.assign(np.float32(joint_q))
    flags = wp.array(np.int32(np.zeros(count) if overflow is None else overflow), dtype=int, device="cpu")
    counts = wp.zeros(len(REASON_NAMES), dtype=int, device="cpu")
    reason = wp.zeros(count, dtype=int, device="cpu")
    done = wp.zeros(count, dtype=wp.int64, device="cpu")
    time_out = wp.zeros(count, dtype=wp.bool, device="cpu")
    inputs = [
        state,
        upload_reference(reference),
        wp.array(np.int32(np.zeros(count) if body_contact is None else body_contact), dtype=int, device="cpu"),
        flags,
        1,
        wp.array(np.int64(np.zeros(count) if length is None else length), dtype=wp.int64, device="cpu"),
        1200,
        max_distance,
        1.5708,
        wp.array(np.int32(np.full(count, TIGHTENING_STEPS) if age is None else age), dtype=int, device="cpu"),
        3.0,
        TIGHTENING_STEPS,
        reason,
        counts,
        done,
        time_out,
    ]
    wp.launch(terminate, dim=count, inputs=inputs, device="cpu")
    names = [REASON_NAMES[index] for index in reason.numpy()]
    np.testing.assert_array_equal(done.numpy() > 0, [name != "none" for name in names])
    np.testing.assert_array_equal(time_out.numpy(), [name == "time_out" for name in names])
    expected = [names.count(name) if name != "none" else 0 for name in REASON_NAMES]
    np.testing.assert_array_equal(counts.numpy(), expected, err_msg="every end is counted once")
    assert not flags.numpy().any(), "the solver's flags are cleared"
    return names


def test_limits_on_distance_and_angle_agree_with_numpy(rng):
    reference = random_states(rng, 500)
    robot = near(rng, reference, 0.7)
    distance = np.linalg.norm(robot.position - reference.position, axis=1)
    angle = (robot.rotation * reference.rotation.inv()).magnitude()
    expected = np.where(distance > 1.0, "distance", np.where(angle > 1.5708, "rotation", "none"))
    assert set(expected) == {"distance", "rotation", "none"}, "the test must see every outcome"
    np.testing.assert_array_equal(reasons(robot, reference), expected)


def test_limits_tighten_with_age(rng):
    age = np.arange(0, 200, 10)
    limit = np.interp(age, [0, TIGHTENING_STEPS], [3.0, 1.0])
    for factor, expected in ((0.99, "none"), (1.01, "distance")):
        reference = random_states(rng, len(age))
        robot = replace(reference, position=reference.position + (factor * limit)[:, None] * [0.6, 0.0, 0.8])
        assert reasons(robot, reference, age=age) == [expected] * len(age)


def test_a_failure_hides_a_time_out(rng):
    robot = random_states(rng, 4)
    names = reasons(robot, robot, body_contact=[0, 1, 0, 1], length=[1199, 0, 1200, 1200])
    assert names == ["none", "body_contact", "time_out", "body_contact"]


def test_a_state_that_is_not_finite_is_found_wherever_it_is(rng):
    robot = random_states(rng, 19)
    joint_q = upload_robot(robot, np.zeros(3)).joint_q.numpy()
    joint_q[np.arange(19), np.arange(19)] = np.where(np.arange(19) % 2, np.nan, np.inf)
    assert reasons(robot, robot, joint_q=joint_q) == ["non_finite"] * 19


def test_an_overflow_of_the_solver_ends_the_episode_but_a_warning_that_does_not_count_does_not(rng):
    robot = random_states(rng, 3)
    assert reasons(robot, robot, overflow=[0, 1, 2]) == ["none", "overflow", "none"]
