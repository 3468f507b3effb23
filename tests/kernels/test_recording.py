import numpy as np
import warp as wp

from kine2go_warp.env.clips import make_placement, upload_clips
from kine2go_warp.env.model import leg_geometry
from kine2go_warp.kernels.recording import record_reference, record_root
from kine2go_warp.robots import GO2
from kine2go_warp.robots.kinematics import foot_positions
from tests.kernels.oracle import random_states, upload_reference, upload_robot

COM = np.array([0.0212, 0.0, -0.0054])


def test_root_is_recorded_at_its_origin_in_the_world_frame(rng):
    states = random_states(rng, 50)
    buffers = [wp.zeros(50, dtype=kind) for kind in (wp.vec3, wp.vec4, wp.vec3, wp.vec3)]
    wp.launch(record_root, dim=50, inputs=[upload_robot(states, COM), *buffers])
    position, wxyz, linear, angular = (buffer.numpy() for buffer in buffers)
    np.testing.assert_array_equal(position, np.float32(states.position))
    np.testing.assert_array_equal(wxyz[:, [1, 2, 3, 0]], np.float32(states.quaternion))
    np.testing.assert_allclose(linear, states.linear, rtol=1e-5, atol=1e-6)
    np.testing.assert_array_equal(angular, np.float32(states.angular))


def test_reference_feet_and_place_in_the_clip(clip, rng):
    count, device = 40, wp.get_device()
    states = random_states(rng, count)
    placement = make_placement(count, device)
    phase = np.float32(rng.uniform(0.0, 1.0, count))
    placement.start_phase.assign(phase)
    step = rng.integers(0, 300, count)
    buffers = [
        wp.zeros(count, dtype=wp.vec3, device=device),
        wp.zeros(count, dtype=wp.vec4, device=device),
        wp.zeros((count, 4), dtype=wp.vec3, device=device),
        wp.zeros(count, dtype=float, device=device),
        wp.zeros(count, dtype=int, device=device),
    ]
    inputs = [
        upload_clips([clip], 1.0 / 60.0, device),
        placement,
        wp.array(np.int32(step), device=device),
        upload_reference(states),
        leg_geometry(GO2, device),
    ]
    wp.launch(record_reference, dim=count, inputs=inputs + buffers, device=device)
    feet = foot_positions(GO2, states.joint)
    expected = np.stack([states.rotation.apply(feet[:, leg]) for leg in range(4)], axis=1) + states.position[:, None]
    np.testing.assert_allclose(buffers[2].numpy(), expected, rtol=1e-5, atol=2e-6)
    turns = np.float64(phase) + step / clip.num_frames
    np.testing.assert_allclose(buffers[4].numpy() + buffers[3].numpy(), turns, atol=1e-4)
    assert np.all((buffers[3].numpy() >= 0.0) & (buffers[3].numpy() < 1.0))
