import numpy as np
from scipy.spatial.transform import Rotation

from kine2go_warp.dataset.quality import rotation_angle


def test_angles_agree_with_scipy_whatever_the_signs(rng):
    a, b = Rotation.random(200, rng=rng), Rotation.random(200, rng=rng)
    close = Rotation.from_rotvec(rng.normal(0.0, 1e-5, (200, 3))) * a
    for other in (b, close, a):
        expected = (a * other.inv()).magnitude()
        for sign in (1.0, -1.0):
            np.testing.assert_allclose(rotation_angle(a.as_quat(), sign * other.as_quat()), expected, atol=1e-12)
