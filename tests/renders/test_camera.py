"""The camera follows smoothly and lags behind nothing."""

import numpy as np
import pytest

from kine2go_warp.renders.camera import SIDE, FollowCamera, smoothed


@pytest.mark.parametrize("rows", [1, 2, 5, 300])
def test_a_straight_path_at_even_speed_stays_as_it_is(rows):
    path = np.array([1.0, 2.0, 3.0]) + np.outer(np.arange(rows), [0.02, -0.01, 0.0])
    np.testing.assert_allclose(smoothed(path, 15.0), path, atol=1e-9)


def test_shaking_is_taken_out(rng):
    shaking = 0.1 * rng.normal(size=(400, 3))
    assert smoothed(shaking, 15.0)[50:-50].std() < 0.25 * shaking.std()


def test_the_camera_neither_leads_nor_lags():
    """Backwards in time the same path gives the same views."""
    time = np.arange(200) / 60.0
    path = np.stack([np.sin(2.0 * time), time**2, 0.0 * time], axis=-1)
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (200, 1))
    there, back = (FollowCamera.of(one, upright, 60.0).targets for one in (path, path[::-1]))
    np.testing.assert_allclose(there, back[::-1], atol=1e-9)


def test_the_camera_keeps_its_side_of_a_robot_that_turns_full_circles():
    turn = 1.5 * np.arange(600) / 60.0
    orientation = np.stack([np.cos(0.5 * turn), 0.0 * turn, 0.0 * turn, np.sin(0.5 * turn)], axis=-1)
    camera = FollowCamera.of(np.zeros((600, 3)), orientation, 60.0)
    np.testing.assert_allclose(camera.azimuths, np.rad2deg(turn) + SIDE, atol=1e-6)
