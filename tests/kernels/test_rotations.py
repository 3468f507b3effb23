import numpy as np
import pytest
import warp as wp
from scipy.spatial.transform import Rotation, Slerp

from kine2go_warp.kernels.rotations import heading_of, rotation_angle, slerp


@wp.kernel(enable_backward=False)
def apply_rotations(
    a: wp.array(dtype=wp.quat),
    b: wp.array(dtype=wp.quat),
    fraction: wp.array(dtype=float),
    angle: wp.array(dtype=float),
    yaw: wp.array(dtype=float),
    between: wp.array(dtype=wp.quat),
):
    index = wp.tid()
    angle[index] = rotation_angle(a[index], b[index])
    yaw[index] = heading_of(a[index])
    between[index] = slerp(a[index], b[index], fraction[index])


def run(a, b, fraction):
    count = len(a)
    inputs = [
        wp.array(np.float32(a), dtype=wp.quat),
        wp.array(np.float32(b), dtype=wp.quat),
        wp.array(np.float32(fraction), dtype=float),
    ]
    results = [wp.zeros(count, dtype=kind) for kind in (float, float, wp.quat)]
    wp.launch(apply_rotations, dim=count, inputs=inputs + results)
    return [result.numpy() for result in results]


@pytest.fixture
def pairs(rng):
    a = Rotation.random(500, rng=rng)
    # Half of the pairs are close together, where an arc cosine would lose its digits.
    near = Rotation.from_rotvec(rng.normal(0.0, 1e-2, (250, 3))) * a[:250]
    b = Rotation.concatenate([near, Rotation.random(250, rng=rng)])
    return a.as_quat(), b.as_quat(), rng.uniform(0.0, 1.0, 500)


def test_angle_and_heading_agree_with_scipy(pairs):
    a, b, fraction = pairs
    angle, yaw, _ = run(a, b, fraction)
    rotation = Rotation.from_quat(np.float32(a))
    expected = (rotation * Rotation.from_quat(np.float32(b)).inv()).magnitude()
    np.testing.assert_allclose(angle, expected, rtol=1e-5, atol=1e-6)
    forward = rotation.apply([1.0, 0.0, 0.0])
    np.testing.assert_allclose(yaw, np.arctan2(forward[:, 1], forward[:, 0]), atol=1e-5)


def test_angle_does_not_depend_on_the_sign_of_a_quaternion(pairs):
    a, b, fraction = pairs
    np.testing.assert_array_equal(run(a, b, fraction)[0], run(-a, b, fraction)[0])
    np.testing.assert_allclose(run(a, b, fraction)[0], run(a, -b, fraction)[0], rtol=1e-6)


def test_slerp_agrees_with_scipy_whatever_the_signs(pairs):
    a, b, fraction = pairs
    for sign in (1.0, -1.0):
        between = Rotation.from_quat(run(a, sign * b, fraction)[2])
        for index in range(0, len(a), 7):
            ends = Rotation.from_quat(np.float32([a[index], b[index]]))
            expected = Slerp([0.0, 1.0], ends)(np.float32(fraction[index]))
            assert (between[index] * expected.inv()).magnitude() < 2e-6
