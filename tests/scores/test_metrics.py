"""Each figure against a plain loop over the valid rows, or a case that can be worked out by hand."""

import subprocess
import sys
import warnings

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kine2go_warp import metrics
from tests.conftest import REPOSITORY
from tests.scores.conftest import LENGTHS

FRAME = 1.0 / 60.0


@pytest.fixture(autouse=True)
def no_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def rotation(wxyz):
    return Rotation.from_quat([wxyz[1], wxyz[2], wxyz[3], wxyz[0]])


def looped(figure, trajectories=3):
    """The mean of the figures that a generator gives for each trajectory."""
    return [np.mean(list(figure(one, LENGTHS[one]))) for one in range(trajectories)]


def test_joint_errors_are_means_over_valid_rows_and_joints(noise):
    position, reference = noise(12), noise(12)

    def squares(one, rows):
        for row in range(rows):
            for joint in range(12):
                yield (position[one, row, joint] - reference[one, row, joint]) ** 2

    expected = looped(squares)
    np.testing.assert_allclose(metrics.mean_square(position, reference), expected)
    np.testing.assert_allclose(metrics.root_mean_square(position, reference), np.sqrt(expected))


def test_distances_are_means_over_valid_rows_and_points(noise):
    feet, reference = noise(4, 3), noise(4, 3)

    def distances(one, rows):
        for row in range(rows):
            for foot in range(4):
                yield np.sqrt(sum((feet[one, row, foot] - reference[one, row, foot]) ** 2))

    np.testing.assert_allclose(metrics.mean_distance(feet, reference), looped(distances))


def test_a_constant_offset_is_the_error(noise):
    position = noise(3)
    np.testing.assert_allclose(metrics.mean_distance(position + np.array([0.3, 0.0, -0.4]), position), 0.5)
    np.testing.assert_allclose(metrics.root_mean_square(position + 0.2, position), 0.2)
    np.testing.assert_allclose(metrics.mean_square(position + 0.2, position), 0.04)


def test_rotation_errors_are_mean_angles(orientations):
    orientation, reference = orientations(), orientations()

    def angles(one, rows):
        for row in range(rows):
            yield (rotation(orientation[one, row]) * rotation(reference[one, row]).inv()).magnitude()

    np.testing.assert_allclose(metrics.rotation_error(orientation, reference), looped(angles))
    np.testing.assert_allclose(metrics.rotation_error(orientation, -orientation), 0.0, atol=1e-7)


def test_points_in_the_base_frame_do_not_change_when_robot_and_points_move_together(noise, orientations, rng):
    feet, root, orientation = noise(4, 3), noise(3), orientations()
    seen = metrics.in_base_frame(feet, root, orientation)
    np.testing.assert_allclose(seen[0, 5, 2], rotation(orientation[0, 5]).inv().apply(feet[0, 5, 2] - root[0, 5]))
    turn, shift = Rotation.random(rng=rng), rng.normal(size=3)
    moved = turn.apply(feet.reshape(-1, 3)).reshape(feet.shape) + shift
    turned = np.full_like(orientation, np.nan)
    for one in range(3):
        for row in range(LENGTHS[one]):
            turned[one, row] = (turn * rotation(orientation[one, row])).as_quat()[[3, 0, 1, 2]]
    np.testing.assert_allclose(
        metrics.in_base_frame(moved, turn.apply(root.reshape(-1, 3)).reshape(root.shape) + shift, turned), seen
    )


def test_velocities_of_a_smooth_motion_have_hardly_any_error():
    time = np.arange(200) * FRAME
    position = np.stack([np.sin(3.0 * time), np.cos(2.0 * time), 0.5 * time], axis=-1)[None]
    velocity = np.stack([3.0 * np.cos(3.0 * time), -2.0 * np.sin(2.0 * time), np.full(200, 0.5)], axis=-1)[None]
    # The error of a central difference is at most a sixth of the third derivative times the step squared.
    bound = np.hypot(27.0, 8.0) * FRAME**2 / 6.0
    assert metrics.linear_velocity_error(velocity, position, FRAME) < bound
    assert metrics.joint_velocity_error(velocity, position, FRAME) < bound
    offset = metrics.linear_velocity_error(velocity + np.array([0.0, 0.0, 0.25]), position, FRAME)
    assert offset == pytest.approx(0.25, abs=bound)


def test_velocity_errors_leave_out_the_ends_of_each_trajectory(noise):
    velocity, position = noise(12), noise(12)

    def squares(one, rows):
        for row in range(1, rows - 1):
            rate = (position[one, row + 1] - position[one, row - 1]) / (2.0 * FRAME)
            yield np.mean((velocity[one, row] - rate) ** 2)

    np.testing.assert_allclose(metrics.joint_velocity_error(velocity, position, FRAME), np.sqrt(looped(squares)))


def test_a_steady_turn_about_any_axis_has_its_angular_velocity(rng):
    rate = rng.normal(size=3)
    start = Rotation.random(rng=rng)
    turns = [Rotation.from_rotvec(rate * row * FRAME) * start for row in range(30)]
    orientation = np.array([one.as_quat()[[3, 0, 1, 2]] for one in turns])
    orientation[10:] *= -1.0  # the same rotations
    np.testing.assert_allclose(metrics.angular_velocity(orientation[None], FRAME)[0], np.tile(rate, (28, 1)))
    off = np.tile(rate + np.array([0.0, 0.1, 0.0]), (1, 30, 1))
    error = metrics.angular_velocity_error(off, orientation[None], FRAME)
    np.testing.assert_allclose(error, 0.1)


def test_a_dragged_foot_slips_at_its_speed_while_it_is_in_contact():
    velocity, force = np.zeros((2, 1, 10, 4, 3))
    velocity[:, :, 0] = [0.3, -0.4, 2.0]
    velocity[:, :, 1] = [9.0, 0.0, 0.0]  # another one, in the air
    force[:, :5, 0, 2] = 50.0
    force[:, :5, 2, 2] = 50.0  # a foot that stands
    force[:, :, 1, 2] = 0.5  # less than a contact
    assert metrics.foot_slip(velocity, force) == pytest.approx(0.25)


def test_slip_is_a_mean_over_feet_and_rows_in_contact(noise):
    velocity, force = noise(4, 3), noise(4, 3)

    def speeds(one, rows):
        for row in range(rows):
            for foot in range(4):
                if np.sqrt(sum(force[one, row, foot] ** 2)) > 1.5:
                    yield np.hypot(*velocity[one, row, foot, :2])

    np.testing.assert_allclose(metrics.foot_slip(velocity, force, 1.5), looped(speeds))


def test_slip_is_unknown_without_contact():
    assert np.isnan(metrics.foot_slip(*np.zeros((2, 1, 10, 4, 3))))


def test_power_is_the_sum_of_its_size_over_the_joints(noise):
    power = noise(12)

    def powers(one, rows):
        for row in range(rows):
            yield sum(abs(power[one, row, joint]) for joint in range(12))

    np.testing.assert_allclose(metrics.mechanical_power(power), looped(powers))


def test_cost_of_transport_of_a_known_walk():
    time = np.arange(61) * FRAME
    position = np.stack([1.5 * time, 0.0 * time, 0.3 + 0.1 * np.sin(9.0 * time)], axis=-1)[None]
    speed = metrics.mean_speed(position, FRAME)
    assert speed == pytest.approx(1.5), "up and down is no way"
    assert metrics.cost_of_transport(np.array([147.15]), speed, 10.0) == pytest.approx(1.0)
    assert np.isnan(metrics.cost_of_transport(np.array([10.0]), np.array([0.01]), 10.0)), "it stands"


def test_shares_count_entries_of_valid_rows(noise):
    values = noise(12)
    limits = np.linspace(0.5, 1.5, 12)

    def counted(condition):
        return looped(lambda one, rows: [condition(values[one, row]).mean() for row in range(rows)])

    np.testing.assert_allclose(metrics.torque_saturation(values), looped(lambda one, rows: values[one, :rows].mean(1)))
    at_limits = counted(lambda row: (row <= -limits + 0.01) | (row >= limits - 0.01))
    np.testing.assert_allclose(metrics.joint_limit_share(values, -limits, limits), at_limits)
    beyond = counted(lambda row: (row < -limits) | (row > limits))
    np.testing.assert_allclose(metrics.action_saturation(values, -limits, limits), beyond)


def test_changes_accelerations_and_jerks_are_differences_of_neighbours(noise):
    values = noise(12)

    def differences(order):
        return looped(
            lambda one, rows: [
                np.abs(np.diff(values[one, row : row + order + 1], n=order, axis=0)).mean()
                for row in range(rows - order)
            ]
        )

    np.testing.assert_allclose(metrics.mean_change(values), differences(1))
    np.testing.assert_allclose(metrics.joint_acceleration(values, FRAME), np.multiply(60.0, differences(1)))
    np.testing.assert_allclose(metrics.joint_jerk(values, FRAME), np.multiply(3600.0, differences(2)))


def test_joint_acceleration_of_a_steady_one():
    velocity = (4.0 * np.arange(20) * FRAME)[None, :, None]
    assert metrics.joint_acceleration(velocity, FRAME) == pytest.approx(4.0)
    assert metrics.joint_jerk(velocity, FRAME) == pytest.approx(0.0, abs=1e-9)


def test_a_trajectory_of_nan_has_no_figures():
    assert np.isnan(metrics.mean_per_trajectory(np.full((2, 5, 3), np.nan))).all()


def test_the_metrics_need_numpy_alone():
    script = (
        "import sys; import kine2go_warp.metrics;"
        "third = {'scipy', 'zarr', 'torch', 'warp', 'newton', 'matplotlib', 'rich'} & set(sys.modules);"
        "assert not third, third"
    )
    subprocess.run([sys.executable, "-c", script], check=True, cwd=REPOSITORY)
