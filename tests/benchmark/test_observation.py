"""What a benchmarked policy sees: now, before and ahead, held against hand-made states."""

import numpy as np
import pytest

from kine2go_warp.benchmark.observation import FEATURES, Observation, parsed, recorded_observations
from kine2go_warp.errors import PolicyError

QUARTER = np.sqrt(0.5)


def state(position=(0.0, 0.0, 0.3), orientation=(1.0, 0.0, 0.0, 0.0), joint=0.0):
    """Two worlds in the same state."""
    return {
        "root_position": np.tile(position, (2, 1)),
        "root_orientation": np.tile(orientation, (2, 1)),
        "root_linear_velocity": np.tile([0.0, 2.0, 0.0], (2, 1)),
        "root_angular_velocity": np.zeros((2, 3)),
        "joint_position": np.full((2, 12), joint),
        "joint_velocity": np.zeros((2, 12)),
    }


def reference(rows=5):
    """A reference that goes along x by 1 m a row."""
    place = np.zeros((2, rows, 3))
    place[..., 0], place[..., 2] = np.arange(rows), 0.3
    return {
        "reference_root_position": place,
        "reference_root_orientation": np.tile([1.0, 0.0, 0.0, 0.0], (2, rows, 1)),
        "reference_joint_position": np.broadcast_to(np.arange(rows, dtype=float)[:, None], (2, rows, 12)),
        "reference_root_linear_velocity": np.tile([1.0, 0.0, 0.0], (2, rows, 1)),
        "reference_root_angular_velocity": np.zeros((2, rows, 3)),
        "reference_joint_velocity": np.zeros((2, rows, 12)),
    }


def test_vectors_are_seen_in_the_frame_of_the_robot():
    seen = Observation(reference(), np.zeros((2, 12)))
    seen.add_state(state(orientation=(QUARTER, 0.0, 0.0, QUARTER)))
    np.testing.assert_allclose(seen["linear_velocity"], [[2.0, 0.0, 0.0]] * 2, atol=1e-6)
    np.testing.assert_allclose(seen["goal_position+2"], [[0.0, -2.0, 0.0]] * 2, atol=1e-6)


def test_rows_before_the_first_are_the_first_and_those_after_the_last_the_last():
    seen = Observation(reference(), np.full((2, 12), 9.0))
    for row in range(3):
        seen.add_state(state(joint=float(row)))
        np.testing.assert_array_equal(seen["joint_position-1"], max(row - 1, 0) * np.ones((2, 12)))
        np.testing.assert_array_equal(seen["action-1"], np.full((2, 12), row + 9.0 if row == 0 else row - 1.0))
        np.testing.assert_array_equal(seen["goal_joint_position+3"], min(row + 3, 4) * np.ones((2, 12)))
        seen.add_action(np.full((2, 12), float(row)))


def test_all_features_of_the_exports_are_there_with_a_row_for_each_world():
    seen = Observation(reference(), np.zeros((2, 12)))
    seen.add_state(state())
    assert set(FEATURES) < set(seen)
    assert all(seen[name].shape[0] == 2 and seen[name].ndim == 2 for name in seen)


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("speed", "no feature 'speed'; known are height"),
        ("joint_position+1", "not known to the robot yet"),
        ("action", "not known to the robot yet"),
        ("joint position", "no feature"),
    ],
)
def test_what_cannot_be_seen_is_refused(key, message):
    with pytest.raises(PolicyError, match=message):
        parsed(key)
    assert key not in Observation(reference(), np.zeros((2, 12)))


def test_recorded_rows_are_seen_as_they_would_be_in_a_rollout():
    rows = reference() | {name: np.repeat(values[:, None], 5, axis=1) for name, values in state().items()}
    rows["action"] = np.broadcast_to(np.arange(5.0)[:, None], (2, 5, 12))
    seen = recorded_observations(rows, np.full((2, 12), -1.0), ("height", "action-1", "goal_position+1"))
    assert seen.shape == (2, 5, 16)
    np.testing.assert_allclose(seen[0, :, 1], [-1.0, 0.0, 1.0, 2.0, 3.0])
    np.testing.assert_allclose(seen[0, :, 13], [1.0, 2.0, 3.0, 4.0, 4.0])
