"""What the recorder writes, against rules that share no code with it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from kine2go_warp.deployment.controller import PolicyController
from kine2go_warp.deployment.export import action_rule
from kine2go_warp.deployment.reference import PlacedClip
from kine2go_warp.env.config import ActionConfig
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.learning.vec_env import ImitationVecEnv
from kine2go_warp.robots import GO2
from kine2go_warp.rollouts.recorder import BYTES_OF_ROW, BYTES_ON_DEVICE, RolloutRecorder, rows_on_device
from kine2go_warp.rollouts.rollout import roll_out
from kine2go_warp.rollouts.row_writer import AsyncRowWriter
from tests.waiting import no_waits

ROWS, WORLDS = 6, 3


class Drawn:
    """Acts at random about means that are drawn, too, some of them beyond the clip."""

    def __init__(self, rng, centre):
        self.rng, self.centre, self.means = rng, centre, []

    def __call__(self, observation, noise):  # noqa: ARG002 - it acts without looking
        mean = self.centre + self.rng.normal(0.0, 0.5, (WORLDS, 12)).astype(np.float32)
        self.means.append(mean)
        action = mean + noise * self.rng.normal(0.0, 0.3, mean.shape).astype(np.float32)
        return torch.from_numpy(mean), torch.from_numpy(np.float32(action))


@pytest.mark.parametrize("mode", ["default_offset", "residual_ff", "residual", "absolute"])
def test_the_mean_action_is_that_of_the_deployed_rule_in_every_mode(mode, clip, small_config, rng, tmp_path):
    """The controller's rule is NumPy of its own; the recorder's comes from the motors' kernels."""
    action = ActionConfig(mode, scale=0.4, clip=0.6, latency=small_config.action.latency)
    config = replace(small_config, num_worlds=WORLDS, action=action)
    env = ImitationVecEnv(ImitationEnvironment([clip], config, "cpu", record_loads=True))
    default = np.float32(GO2.default_joint_position)
    actor = Drawn(rng, default if mode == "absolute" else np.zeros(12, np.float32))
    with AsyncRowWriter(tmp_path / "rows") as writer:
        recorded = roll_out(env, actor, 1.0, ROWS, writer)
    rows = recorded.rows(np.arange(WORLDS))
    metadata = SimpleNamespace(action=action_rule(config, GO2), default_joint_position=GO2.default_joint_position)
    assert np.abs(rows["action"] - rows["action_mean"]).max() > 0.1
    for world in range(WORLDS):
        reference = PlacedClip(clip, config.control_rate)
        reference.place(float(recorded.initial.phase[world]), (0.0, 0.0), float(recorded.initial.heading[world]))
        for step in range(recorded.length[world]):
            controller = SimpleNamespace(metadata=metadata, reference=reference, step=step)
            target = PolicyController.joint_target(controller, actor.means[step][world])  # pyright: ignore
            expected = (target - default) / GO2.action_scale
            np.testing.assert_allclose(rows["action_mean"][world, step], expected, atol=2e-4, err_msg=f"row {step}")


def test_recording_rows_reads_nothing_from_the_device(clip, small_config):
    environment = ImitationEnvironment([clip], replace(small_config, num_worlds=WORLDS), "cpu", record_loads=True)
    recorder = RolloutRecorder(environment, SimpleNamespace(submit=lambda *_: None))
    mean = torch.zeros(WORLDS, 12)
    recorder.record_state(mean)
    recorder.record_action()
    with no_waits():
        for _ in range(3):
            recorder.record_state(mean)
            environment.step()
            recorder.record_action()


@pytest.mark.parametrize(("worlds", "rows"), [(1, 128), (20, 128), (4096, 7), (8192, 3), (200_000, 1)])
def test_many_worlds_are_handed_over_in_smaller_blocks(worlds, rows):
    assert rows_on_device(worlds) == rows
    assert rows == 1 or rows * worlds * BYTES_OF_ROW <= BYTES_ON_DEVICE


def test_a_row_takes_about_what_blocks_are_planned_by(clip, small_config):
    environment = ImitationEnvironment([clip], replace(small_config, num_worlds=WORLDS), "cpu", record_loads=True)
    taken = []
    recorder = RolloutRecorder(environment, SimpleNamespace(submit=lambda blocks, _: taken.append(blocks)))
    recorder.record_state(torch.zeros(WORLDS, 12))
    recorder.record_action()
    recorder.finish()
    row = sum(block.nbytes for block in taken[0].values()) / WORLDS
    assert 0.8 * BYTES_OF_ROW < row < 1.2 * BYTES_OF_ROW
