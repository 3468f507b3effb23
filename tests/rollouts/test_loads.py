"""Loads over the substeps of a row, against the laws of motion and plain MuJoCo; and which action acts when."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
import torch

from kine2go_warp.dataset import open_dataset
from kine2go_warp.env.config import ActionConfig
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.mujoco_engine import MujocoRobot
from kine2go_warp.learning.vec_env import ImitationVecEnv
from kine2go_warp.robots import GO2
from kine2go_warp.rollouts.rollout import roll_out
from kine2go_warp.rollouts.row_writer import AsyncRowWriter
from kine2go_warp.rollouts.worlds import environment_config
from kine2go_warp.rotations import rotate

DURATION = 1.0 / 60.0


@pytest.fixture(scope="module")
def data(clean_dataset):
    return open_dataset(clean_dataset, include_rejected=True).load("dog_trot")


@pytest.fixture(scope="module")
def robot(data):
    """A function that puts the robot of a trajectory into the state of a row, in MuJoCo."""
    made = MujocoRobot(environment_config(data.attributes, "dataset"), GO2)
    nominal_mass, nominal_com = float(made.model.body_mass[made.base]), made.com_b.copy()

    def placed(index, row):
        rows, drawn = data.trajectories.rows, data.trajectories.groups["randomization"]
        com = nominal_com + drawn["base_com"][index]
        made.set_body(nominal_mass + float(drawn["base_mass"][index]), com, float(drawn["friction"][index]))
        orientation, turn = rows["root_orientation"][index, row], rows["root_angular_velocity"][index, row]
        velocity = rows["root_linear_velocity"][index, row] + np.cross(turn, rotate(orientation, com))
        coordinates = [rows["root_position"][index, row], orientation[[1, 2, 3, 0]], rows["joint_position"][index, row]]
        rates = [velocity, turn, rows["joint_velocity"][index, row]]
        config, targets = environment_config(data.attributes, "dataset"), rows["joint_target"][index]
        coming = [targets[row + (s - made.motors.delay) // config.substeps] for s in range(made.motors.delay)]
        state = np.concatenate(coordinates), np.concatenate(rates)
        made.set_state(*state, coming, rows["friction_anchor"][index, row])
        mujoco.mj_forward(made.model, made.data)
        return made

    return placed


def momentum(robot):
    """Linear momentum of the whole robot in the world frame [kg m/s]."""
    mujoco.mj_subtreeVel(robot.model, robot.data)
    return robot.data.subtree_linvel[0] * robot.model.body_subtreemass[0]


def test_mean_forces_change_the_momentum_as_newtons_second_law_says(data, robot):
    """Those of the last substep alone do not."""
    rows = data.trajectories.rows
    missed, missed_by_last = [], []
    for row in range(20, 60):
        if rows["push"][0, row].any() or rows["leg_contact"][0, row : row + 2].any():
            continue
        before, after = momentum(robot(0, row)), momentum(robot(0, row + 1))
        weight = GO2.mass + float(data.trajectories.groups["randomization"]["base_mass"][0])
        change = (after - before) / DURATION + np.array([0.0, 0.0, 9.81 * weight])
        missed.append(np.linalg.norm(change - rows["foot_contact_force_mean"][0, row + 1].sum(axis=0)))
        missed_by_last.append(np.linalg.norm(change - rows["foot_contact_force"][0, row + 1].sum(axis=0)))
    assert len(missed) > 20
    # Of some 150 N. Joint angles advance with the new velocity for a whole substep, which does not quite keep momentum.
    assert np.median(missed) < 2.0
    assert max(missed) < 5.0
    assert np.median(missed_by_last) > 5.0 * np.median(missed)


def test_torques_and_power_over_the_substeps_are_those_of_plain_mujoco(data, robot):
    rows, differences = data.trajectories.rows, []
    for row in range(20, 60):
        if rows["push"][0, row].any() or rows["leg_contact"][0, row : row + 2].any():
            continue
        one = robot(0, row)
        one.step(rows["joint_target"][0, row])
        differences.append([
            np.abs(one.torque - rows["joint_torque"][0, row + 1]).max(),
            np.abs(one.torque_at_limit - rows["torque_at_limit"][0, row + 1]).max(),
            np.abs(one.joint_power - rows["joint_power_mean"][0, row + 1]).max(),
        ])  # fmt: skip
    assert len(differences) > 20
    assert np.all(np.median(differences, axis=0) < [1e-3, 1e-4, 1e-2]), np.median(differences, axis=0)


def test_the_final_state_is_where_the_last_rows_step_leads(data, robot):
    rows, final = data.trajectories.rows, data.trajectories.groups["final_state"]
    missed = []
    for index in (0, 1, 3, 4):
        if rows["push"][index, 149].any() or rows["leg_contact"][index, 149]:
            continue
        one = robot(index, 149)
        one.step(rows["joint_target"][index, 149])
        missed.append(np.abs(one.data.qpos[7:] - final["joint_position"][index]).max())
        assert np.sum(final["root_orientation"][index] * rows["root_orientation"][index, 149]) > 0.9
    assert len(missed) > 1
    assert np.median(missed) < 1e-5


def test_peaks_are_at_least_what_the_last_substep_and_the_mean_show(data):
    rows = {name: values[:, 1:] for name, values in data.trajectories.rows.items()}
    force = np.linalg.norm(rows["foot_contact_force"], axis=-1)
    pairs = [
        ("joint_torque_peak", np.abs(rows["joint_torque"])),
        ("joint_torque_peak", np.abs(rows["joint_torque_mean"])),
        ("joint_power_peak", np.abs(rows["joint_torque"] * rows["joint_velocity"])),
        ("joint_power_peak", np.abs(rows["joint_power_mean"])),
        ("foot_contact_force_peak", force),
    ]
    for name, least in pairs:
        there = np.isfinite(least)
        assert np.all(rows[name][there] >= (1.0 - 1e-5) * least[there] - 1e-5), name
        assert np.mean(rows[name][there] > 1.1 * least[there] + 1e-3) > 0.1, f"{name} says more than that"


class Fixed:
    """Acts as drawn beforehand, without looking."""

    def __init__(self, actions):
        self.actions, self.row = actions, 0

    def __call__(self, observation, noise):  # noqa: ARG002
        self.row += 1
        action = torch.from_numpy(self.actions[self.row - 1])
        return action, action


def test_a_changed_action_moves_the_row_first_that_the_action_rule_names(clip, small_config, rng, tmp_path):
    latencies, changed, rows = np.array([0.0, 0.01, 0.02, 0.05]), 3, 9
    action = ActionConfig("default_offset", latency=float(latencies.max()))
    config = replace(small_config, num_worlds=4, action=action)
    environment = ImitationEnvironment([clip], config, "cpu", record_loads=True)
    delay = np.round(latencies / config.substep_duration).astype(np.int32)
    actions = rng.normal(0.0, 0.3, (rows, 4, 12)).astype(np.float32)
    recorded = []
    for number in range(2):
        environment.restart(1)
        environment.motors.model.delay.assign(delay)
        actions[changed, :, 4] += 2.0 * number
        with AsyncRowWriter(tmp_path / f"{number}") as writer:
            recorded.append(
                roll_out(ImitationVecEnv(environment), Fixed(actions), 0.0, rows, writer).rows(np.arange(4))
            )
    one, other = recorded
    difference = np.abs(one["joint_target"] - other["joint_target"]).max(axis=(0, 2))
    assert np.flatnonzero(difference).tolist() == [changed]
    moved = (one["joint_position"] != other["joint_position"]).any(axis=-1)
    first = np.argmax(moved, axis=1)
    assert first.tolist() == [4, 4, 5, 7]
    np.testing.assert_array_equal(first, changed + 1 + delay // config.substeps)
    for world in range(4):
        last = (config.substeps - 1 - delay[world]) // config.substeps
        for row in range(1 - last, rows):
            np.testing.assert_array_equal(one["applied_target"][world, row], one["joint_target"][world, row - 1 + last])
