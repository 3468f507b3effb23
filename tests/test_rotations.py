"""Quaternions against SciPy's rotations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kine2go_warp.rotations import conjugate, heading, multiply, rotate, rotation_angle, rotation_vector


def scipy_rotation(wxyz):
    return Rotation.from_quat(wxyz[..., [1, 2, 3, 0]])


@pytest.fixture
def pair(rng):
    return tuple(values / np.linalg.norm(values, axis=-1, keepdims=True) for values in rng.normal(size=(2, 50, 4)))


def test_products_and_inverses_turn_vectors_as_scipys_do(pair, rng):
    a, b = pair
    vector = rng.normal(size=(50, 3))
    expected = (scipy_rotation(a) * scipy_rotation(b).inv()).apply(vector)
    np.testing.assert_allclose(rotate(multiply(a, conjugate(b)), vector), expected, atol=1e-12)


def test_rotation_vectors_are_scipys_also_for_tiny_turns(pair):
    np.testing.assert_allclose(rotation_vector(pair[0]), scipy_rotation(pair[0]).as_rotvec(), atol=1e-12)
    tiny = np.array([1.0, 1e-14, 0.0, 0.0])
    np.testing.assert_allclose(rotation_vector(tiny), [2e-14, 0.0, 0.0], rtol=1e-6)
    assert np.all(rotation_vector(np.array([1.0, 0.0, 0.0, 0.0])) == 0.0)


def test_yaw_is_where_the_x_axis_points(pair):
    axis = scipy_rotation(pair[0]).apply([1.0, 0.0, 0.0])
    np.testing.assert_allclose(heading(pair[0]), np.arctan2(axis[:, 1], axis[:, 0]), atol=1e-12)


def test_nan_stays_nan():
    nothing = np.full(4, np.nan)
    assert np.isnan(rotation_vector(nothing)).all()
    assert np.isnan(heading(nothing))


def test_angles_agree_with_scipy_whatever_the_signs(rng):
    a, b = Rotation.random(200, rng=rng), Rotation.random(200, rng=rng)
    close = Rotation.from_rotvec(rng.normal(0.0, 1e-5, (200, 3))) * a
    for other in (b, close, a):
        expected = (a * other.inv()).magnitude()
        for sign in (1.0, -1.0):
            np.testing.assert_allclose(rotation_angle(a.as_quat(), sign * other.as_quat()), expected, atol=1e-12)
