"""The film that the page draws is of the robot that was recorded."""

import base64

import numpy as np
from scipy.spatial.transform import Rotation

from kine2go_warp.dataset import open_dataset
from kine2go_warp.renders.video import read_trajectories
from kine2go_warp.reports.film import RATE, film
from kine2go_warp.robots import GO2
from kine2go_warp.robots.kinematics import foot_positions


def numbers(text):
    return 1e-3 * np.frombuffer(base64.b64decode(text), "<i2").astype(float)


def test_heights_are_those_of_the_recorded_feet_and_marks_pass_at_the_robots_speed(walks):
    motion = open_dataset(walks).motion("walk")
    (trajectory,) = read_trajectories(motion, [0])
    shown = film(trajectory, GO2)
    pictures = int(trajectory.time[-1] * RATE) + 1
    points = numbers(shown.points).reshape(pictures, 2, 4, 4, 2)
    rows = [trajectory.row_at(number / RATE) for number in range(pictures)]
    base = trajectory.rows["root_position"][rows]
    turn = Rotation.from_quat(trajectory.rows["root_orientation"][rows], scalar_first=True).as_matrix()
    feet_b = foot_positions(GO2, trajectory.rows["joint_position"][rows])
    heights = np.einsum("tj,tfj->tf", turn[:, 2], feet_b) + base[:, 2:]
    np.testing.assert_allclose(points[:, 0, :, 3, 1], heights, atol=2e-3)
    start = trajectory.rows["root_orientation"][0]
    ahead = np.arctan2(2 * (start[0] * start[3] + start[1] * start[2]), 1 - 2 * (start[2] ** 2 + start[3] ** 2))
    along = base[:, 0] * np.cos(ahead) + base[:, 1] * np.sin(ahead)
    moved = np.diff(numbers(shown.ground)) - np.diff(along)
    np.testing.assert_allclose(moved, 0.25 * np.round(moved / 0.25), atol=2e-3)
