from dataclasses import replace

import numpy as np
import warp as wp

from kine2go_warp.env.clips import make_placement, upload_clips
from kine2go_warp.env.config import EnvConfig
from kine2go_warp.kernels.terminations import end_episodes
from tests.kernels.oracle import near, random_states, upload_reference, upload_robot, world_view

TIGHTENING_STEPS = 100
TERMS, NAMES = EnvConfig().active_terminations, EnvConfig().reason_names


def reasons(clip, robot, reference, body_contact=None, length=None, joint_q=None, overflow=None, age=None, rests=None):
    count = len(robot.position)
    state = upload_robot(robot, np.zeros(3))
    if joint_q is not None:
        state.joint_q.assign(np.float32(joint_q))

    def per_world(values, dtype=int):
        return wp.array(np.zeros(count) if values is None else np.array(values), dtype=dtype)

    with wp.ScopedDevice(wp.get_device()):
        flags, reason, counts = per_world(overflow), per_world(None), wp.zeros(len(NAMES), dtype=int)
        done, time_out = per_world(None, wp.int64), per_world(None, wp.bool)
        target = upload_reference(reference)
        target.body_rests = per_world(rests)
        view = world_view(
            placement=make_placement(count, wp.get_device()),
            clips=upload_clips([clip], 1.0 / 60.0, wp.get_device()),
            robot=state,
            reference=target,
            body_contact=per_world(body_contact),
            overflow=flags,
            overflow_mask=1,
            episode_length=per_world(length, wp.int64),
            max_episode_length=1200,
            world_steps=per_world(np.full(count, TIGHTENING_STEPS) if age is None else age),
            initial_limit_scale=3.0,
            limit_anneal_steps=TIGHTENING_STEPS,
        )
        conditions = wp.zeros((count, len(TERMS)), dtype=float)
        for column, term in enumerate(TERMS):
            term.launch(view, conditions, column)
        is_time_out = wp.array([term.is_time_out for term in TERMS], dtype=wp.bool)
        wp.launch(end_episodes, dim=count, inputs=[conditions, is_time_out, flags, reason, counts, done, time_out])
    names = [NAMES[index] for index in reason.numpy()]
    np.testing.assert_array_equal(done.numpy() > 0, [name != "" for name in names])
    np.testing.assert_array_equal(time_out.numpy(), [name == "time_out" for name in names])
    expected = [names.count(name) if name else 0 for name in NAMES]
    np.testing.assert_array_equal(counts.numpy(), expected, err_msg="every end is counted once")
    assert not flags.numpy().any(), "the solver's flags are cleared"
    return names


def test_limits_on_distance_and_angle_agree_with_numpy(clip, rng):
    reference = random_states(rng, 500)
    robot = near(rng, reference, 0.7)
    distance = np.linalg.norm(robot.position - reference.position, axis=1)
    angle = (robot.rotation * reference.rotation.inv()).magnitude()
    expected = np.where(distance > 1.0, "distance", np.where(angle > 1.5708, "rotation", ""))
    assert set(expected) == {"distance", "rotation", ""}, "the test must see every outcome"
    np.testing.assert_array_equal(reasons(clip, robot, reference), expected)


def test_limits_tighten_with_age(clip, rng):
    age = np.arange(0, 200, 10)
    limit = np.interp(age, [0, TIGHTENING_STEPS], [3.0, 1.0])
    for factor, expected in ((0.99, ""), (1.01, "distance")):
        reference = random_states(rng, len(age))
        robot = replace(reference, position=reference.position + (factor * limit)[:, None] * [0.6, 0.0, 0.8])
        assert reasons(clip, robot, reference, age=age) == [expected] * len(age)


def test_a_failure_hides_a_time_out(clip, rng):
    robot = random_states(rng, 4)
    names = reasons(clip, robot, robot, body_contact=[0, 1, 0, 1], length=[1199, 0, 1200, 1200])
    assert names == ["", "body_contact", "time_out", "body_contact"]


def test_a_body_may_touch_the_ground_where_the_reference_rests_there(clip, rng):
    robot = random_states(rng, 4)
    names = reasons(clip, robot, robot, body_contact=[0, 1, 0, 1], rests=[0, 0, 1, 1])
    assert names == ["", "body_contact", "", ""]


def test_a_state_that_is_not_finite_is_found_wherever_it_is(clip, rng):
    robot = random_states(rng, 19)
    joint_q = upload_robot(robot, np.zeros(3)).joint_q.numpy()
    joint_q[np.arange(19), np.arange(19)] = np.where(np.arange(19) % 2, np.nan, np.inf)
    assert reasons(clip, robot, robot, joint_q=joint_q) == ["non_finite"] * 19


def test_an_overflow_of_the_solver_ends_the_episode_but_a_warning_that_does_not_count_does_not(clip, rng):
    robot = random_states(rng, 3)
    assert reasons(clip, robot, robot, overflow=[0, 1, 2]) == ["", "overflow", ""]


def test_a_failure_hides_a_time_out_wherever_it_stands_in_the_list():
    conditions = wp.array(np.float32([[0, 0, 1], [1, 0, 0], [1, 1, 1], [0, 0, 0], [0, 1, 1]]))
    is_time_out = wp.array([True, False, False], dtype=wp.bool)
    overflow, reason, counts = (wp.zeros(5, dtype=int) for _ in range(3))
    done, time_out = wp.zeros(5, dtype=wp.int64), wp.zeros(5, dtype=wp.bool)
    inputs = [conditions, is_time_out, overflow, reason, counts, done, time_out]
    wp.launch(end_episodes, dim=5, inputs=inputs)
    assert reason.numpy().tolist() == [3, 1, 2, 0, 2]
    assert time_out.numpy().tolist() == [False, True, False, False, False]
