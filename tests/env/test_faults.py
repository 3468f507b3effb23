"""Faults of the simulation: counted, reset, and with the strict stepper saved for a replay."""

from dataclasses import replace

import numpy as np
import pytest
from mujoco_warp import OverflowType

from kine2go_warp.env.config import SolverConfig
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.faults import StrictStepper, fault_counts
from kine2go_warp.env.snapshot import WorldSnapshot
from kine2go_warp.env.terms.terminations import with_limits
from kine2go_warp.errors import Kine2GoError, SimulationError
from kine2go_warp.robots import GO2
from tests.env.helpers import EVERYTHING, drive


@pytest.fixture(scope="module")
def cramped(small_config):
    """Room for four standing feet, but not for a robot that lies on the ground."""
    solver = SolverConfig(max_contacts=5, max_constraints=16)
    return replace(small_config, num_worlds=4, solver=solver, terminations=with_limits(50.0, 10.0))


def fall(environment, steps):
    """Drives the robots wildly until they fall; returns why episodes ended."""
    rng, reasons = np.random.default_rng(0), []
    for _ in range(steps):
        environment.action.assign(np.float32(rng.normal(0.0, 6.0, (environment.num_worlds, 12))))
        environment.step()
        reasons += environment.episodes.reason.numpy().tolist()
    return [environment.config.reason_names[reason] for reason in reasons if reason]


def test_full_buffers_are_noticed_counted_and_reset(clip, cramped):
    environment = ImitationEnvironment([clip], cramped, "cpu")
    reasons = fall(environment, 120)
    assert reasons.count("overflow") > 0
    assert fault_counts(environment)["overflow"] == reasons.count("overflow")
    assert np.isfinite(environment.observation.numpy()).all()
    environment.restart(7)
    assert fault_counts(environment) == {"non_finite": 0, "overflow": 0}


def test_an_overflow_of_an_early_substep_is_noticed(clip, cramped):
    """A robot lies on the ground and leaves it so fast that the last substep needs few rows."""
    environment = ImitationEnvironment([clip], cramped, "cpu")
    joint_q, joint_qd = environment.robot.joint_q.numpy(), environment.robot.joint_qd.numpy()
    joint_q[:, 2], joint_q[:, 3:7], joint_q[:, 7:] = 0.054, (0.0, 0.0, 0.0, 1.0), np.tile([0.0, 1.5, -2.7], 4)
    joint_qd[:], joint_qd[:, 2] = 0.0, 20.0
    environment.robot.joint_q.assign(joint_q)
    environment.robot.joint_qd.assign(joint_qd)
    environment.action.assign(np.float32(joint_q[:, 7:] - GO2.default_joint_position) / 0.25)
    environment.step()
    data = environment.simulation.data
    assert (data.nefc.numpy() <= data.njmax).all(), "the last substep must have room"
    assert fault_counts(environment)["overflow"] == environment.num_worlds


def test_the_pool_of_contacts_has_room_for_every_shape_of_every_world(clip, small_config):
    """All are deep in the ground: four feet and the head, eight capsules with two ends, a box with eight corners."""
    environment = ImitationEnvironment([clip], small_config, "cpu", use_graph=False)
    joint_q = environment.robot.joint_q.numpy()
    joint_q[:, 2], joint_q[:, 3:7], joint_q[:, 7:] = -1.0, (0.0, 0.0, 0.0, 1.0), np.tile([0.0, 0.9, -1.8], 4)
    environment.robot.joint_q.assign(joint_q)
    environment.step()
    data = environment.simulation.data
    assert data.nacon.numpy()[0] == environment.num_worlds * (4 + 1 + 8 * 2 + 8)
    full = data.overflow.numpy() & int(OverflowType.NARROWPHASE | OverflowType.BROADPHASE)
    assert not full.any()


def test_the_default_buffers_hold_a_robot_that_falls_in_every_way(clip, small_config):
    config = replace(small_config, num_worlds=64, terminations=with_limits(50.0, 10.0))
    environment = ImitationEnvironment([clip], config, "cpu")
    assert "body_contact" in fall(environment, 120)
    assert fault_counts(environment) == {"non_finite": 0, "overflow": 0}


def test_a_state_that_is_not_finite_ends_the_episode_and_harms_no_other(clip, small_config):
    environment = ImitationEnvironment([clip], small_config, "cpu")
    joint_qd = environment.robot.joint_qd.numpy()
    joint_qd[3, 8] = np.nan
    environment.robot.joint_qd.assign(joint_qd)
    environment.step()
    assert fault_counts(environment)["non_finite"] == 1
    assert environment.config.reason_names[environment.episodes.reason.numpy()[3]] == "non_finite"
    last = drive(environment, 5, 0)[-1]
    assert np.isfinite(last["observation"]).all()
    assert np.isfinite(last["joint_q"]).all()


def test_the_strict_stepper_saves_the_state_from_which_the_fault_follows(clip, cramped, tmp_path):
    environment = ImitationEnvironment([clip], cramped, "cpu")
    stepper, rng = StrictStepper(environment, tmp_path), np.random.default_rng(0)

    def step_until_it_stops():
        for _ in range(200):
            environment.action.assign(np.float32(rng.normal(0.0, 6.0, (4, 12))))
            stepper.step()

    with pytest.raises(SimulationError, match=r"overflow in world \d of 4") as caught:
        step_until_it_stops()
    (file,) = tmp_path.glob("*.npz")
    assert str(file) in str(caught.value)
    alone = ImitationEnvironment([clip], replace(cramped, num_worlds=1), "cpu")
    WorldSnapshot.load(file).restore(alone)
    alone.step()
    assert alone.config.reason_names[alone.episodes.reason.numpy()[0]] == "overflow"


def test_a_world_restored_elsewhere_goes_on_bit_for_bit(clip, small_config, rng):
    config = replace(small_config, randomization=EVERYTHING, terminations=with_limits(50.0, 10.0))
    environment = ImitationEnvironment([clip], config, "cpu")
    drive(environment, 25, 4)
    which = np.array([5])
    taken = WorldSnapshot.take(environment).selected(which)
    alone = ImitationEnvironment([clip], replace(config, num_worlds=1, seed=99), "cpu")
    taken.restore(alone)
    for _ in range(60):
        output = np.float32(rng.normal(0.0, 0.6, (config.num_worlds, 12)))
        environment.action.assign(output)
        alone.action.assign(output[which])
        environment.step()
        alone.step()
        one, other = environment.robot.joint_q.numpy()[5], alone.robot.joint_q.numpy()[0]
        assert one.tobytes() == other.tobytes()
        assert environment.reward_terms.numpy()[5].tobytes() == alone.reward_terms.numpy()[0].tobytes()
        assert environment.episodes.reason.numpy()[5] == alone.episodes.reason.numpy()[0]


def test_a_snapshot_survives_its_file_and_refuses_what_does_not_fit(environment, clip, small_config, tmp_path):
    taken = WorldSnapshot.take(environment)
    taken.save(tmp_path / "state.npz")
    loaded = WorldSnapshot.load(tmp_path / "state.npz")
    for name, values in taken.arrays.items():
        np.testing.assert_array_equal(loaded.arrays[name], values)
    with pytest.raises(Kine2GoError, match="8 worlds does not fit 2"):
        loaded.restore(ImitationEnvironment([clip], replace(small_config, num_worlds=2), "cpu"))
    (tmp_path / "broken.npz").write_bytes(b"PK nothing")
    with pytest.raises(Kine2GoError, match=r"broken\.npz: not a snapshot"):
        WorldSnapshot.load(tmp_path / "broken.npz")


def test_without_faults_the_strict_stepper_changes_nothing(clip, small_config, tmp_path):
    plain = ImitationEnvironment([clip], small_config, "cpu")
    strict = ImitationEnvironment([clip], small_config, "cpu")
    stepper = StrictStepper(strict, tmp_path)
    for _ in range(5):
        plain.step()
        stepper.step()
    assert plain.observation.numpy().tobytes() == strict.observation.numpy().tobytes()
    assert not list(tmp_path.iterdir())
