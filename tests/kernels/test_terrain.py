import numpy as np
import warp as wp
from scipy.interpolate import RegularGridInterpolator

from kine2go_warp.env.terrain import FLAT, HeightField
from kine2go_warp.kernels.terrain import Terrain, ground_height, reference_climb, reference_lift


@wp.kernel
def probe(
    terrain: Terrain,
    places: wp.array(dtype=wp.vec2),
    velocities: wp.array(dtype=wp.vec2),
    found: wp.array2d(dtype=float),
):
    index = wp.tid()
    found[index, 0] = ground_height(terrain, places[index])
    found[index, 1] = reference_lift(terrain, places[index])
    found[index, 2] = reference_climb(terrain, places[index], velocities[index])


def probed(field, places, velocities):
    found = wp.zeros((len(places), 3), dtype=float)
    arrays = [wp.array(np.float32(values), dtype=wp.vec2) for values in (places, velocities)]
    wp.launch(probe, dim=len(places), inputs=[field.upload(wp.get_device()), *arrays, found])
    return found.numpy().T


def test_heights_are_interpolated_as_scipy_does_and_go_on_level_beyond_the_edge(rng):
    height, lift = rng.normal(0.0, 0.1, (2, 21, 21)).astype(np.float32)
    field, axis = HeightField(height, lift, 3.0), np.linspace(-3.0, 3.0, 21)
    places = rng.uniform(-4.0, 4.0, (500, 2))
    ground, lifted, _ = probed(field, places, np.zeros((500, 2)))
    inside = np.clip(places, -3.0, 3.0)[:, ::-1]
    np.testing.assert_allclose(ground, RegularGridInterpolator((axis, axis), height)(inside), atol=2e-6)
    np.testing.assert_allclose(lifted, RegularGridInterpolator((axis, axis), lift)(inside), atol=2e-6)


def test_the_climb_is_slope_times_speed(rng):
    axis = np.linspace(-5.0, 5.0, 51)
    x, y = np.meshgrid(axis, axis)
    plane = np.float32(0.3 * x - 0.2 * y)
    velocities = rng.normal(0.0, 1.0, (100, 2))
    *_, climb = probed(HeightField(plane, plane, 5.0), rng.uniform(-4.0, 4.0, (100, 2)), velocities)
    np.testing.assert_allclose(climb, velocities @ [0.3, -0.2], atol=1e-3)


def test_flat_ground_is_zero_everywhere(rng):
    assert not np.any(probed(FLAT, rng.uniform(-50.0, 50.0, (100, 2)), rng.normal(0.0, 1.0, (100, 2))))
