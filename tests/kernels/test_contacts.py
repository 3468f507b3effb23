import numpy as np
import warp as wp

from kine2go_warp.kernels.contacts import ROLE_BODY, ROLE_IGNORED, ROLE_LEG, clear_contacts, collect_contacts, vec5

ROLES = np.array([ROLE_IGNORED, 0, 1, 2, 3, ROLE_BODY, ROLE_LEG], dtype=np.int32)


def collect(geoms, worlds, frames, frictions, addresses, rows, count=None, num_worlds=3):
    results = [wp.zeros((num_worlds, 4), dtype=wp.vec3)]
    results += [wp.full(num_worlds, 7, dtype=int) for _ in range(2)]
    wp.launch(clear_contacts, dim=num_worlds, inputs=results)
    friction = np.zeros((len(geoms), 5), dtype=np.float32)
    friction[:, 0] = frictions
    address = np.zeros((len(geoms), 10), dtype=np.int32)
    address[:, 0] = addresses
    inputs = [
        wp.array([len(geoms) if count is None else count], dtype=int),
        wp.array(np.int32(geoms), dtype=wp.vec2i),
        wp.array(np.int32(worlds), dtype=int),
        wp.array(np.float32(frames), dtype=wp.mat33),
        wp.array(friction, dtype=vec5),
        wp.array(address, dtype=int),
        wp.array(np.float32(rows), dtype=float),
        wp.array(ROLES, dtype=int),
    ]
    wp.launch(collect_contacts, dim=len(geoms), inputs=inputs + results)
    return [result.numpy() for result in results]


def test_forces_agree_with_the_pyramids_edges(rng):
    from scipy.spatial.transform import Rotation

    count = 60
    frames = Rotation.random(count, rng=rng).as_matrix()
    frictions = np.float32(rng.uniform(0.3, 1.2, count))
    rows = rng.uniform(0.0, 50.0, (3, 80))
    worlds, addresses = rng.integers(0, 3, count), rng.integers(0, 77, count)
    geoms = np.stack([np.zeros(count, int), rng.integers(1, 5, count)], axis=1)
    swapped = rng.random(count) < 0.5
    geoms[swapped] = geoms[swapped][:, ::-1]
    force, _, _ = collect(geoms, worlds, frames, frictions, addresses, rows)
    expected = np.zeros((3, 4, 3))
    for contact in range(count):
        edges = np.float32(rows[worlds[contact], addresses[contact] : addresses[contact] + 4])
        local = np.array(
            [
                edges.sum(),
                frictions[contact] * (edges[0] - edges[1]),
                frictions[contact] * (edges[2] - edges[3]),
            ]
        )
        pushed = local @ frames[contact]
        # The force acts on the second shape; where the foot comes first, it feels the reaction.
        sign = -1.0 if swapped[contact] else 1.0
        expected[worlds[contact], geoms[contact].max() - 1] += sign * pushed
    np.testing.assert_allclose(force, expected, rtol=1e-5, atol=1e-3)


def test_body_and_legs_are_flagged_and_the_rest_is_ignored():
    frames = np.tile(np.eye(3), (4, 1, 1))
    geoms = [[0, 5], [0, 6], [0, 5], [0, 5]]
    rows = np.ones((3, 20))
    _, body, leg = collect(geoms, [0, 1, 2, 2], frames, [1.0] * 4, [0, 4, -1, 0], rows, count=3)
    # The third contact exerts no force (no row), the fourth lies beyond the count.
    np.testing.assert_array_equal(body, [1, 0, 0])
    np.testing.assert_array_equal(leg, [0, 1, 0])
