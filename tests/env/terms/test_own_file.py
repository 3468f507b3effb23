"""The example of docs/environment.md: terms in a user's own file, from training to dataset."""

import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.observations import observation_layout
from kine2go_warp.env.terms.base import with_term
from kine2go_warp.env.terms.terminations import with_limits
from kine2go_warp.errors import DatasetError
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.robots import GO2
from kine2go_warp.rollouts.config import GatherConfig
from kine2go_warp.rollouts.gather import gather
from tests.conftest import ANYTHING_GOES, REPOSITORY

PAGE = (REPOSITORY / "docs" / "environment.md").read_text()
TERMS = ("joint_position", "joint_velocity", "foot_position", "root_pose", "root_velocity", "foot_slip")


@pytest.fixture(scope="module")
def own_policy(clip, tmp_path_factory):
    """A policy after one iteration, trained from the command line with the file of the page."""
    folder = tmp_path_factory.mktemp("own")
    (example,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    (folder / "my_file.py").write_text(example)
    clip.save(folder / "trot.npz")
    command = [Path(sys.executable).with_name("kine2go"), "train", "trot.npz", "--preset", "my_file.py:PRESET"]
    command += ["--env.num-worlds", "8", "--ppo.iterations", "1", "--processes", "1", "--device", "cpu"]
    result = subprocess.run([*command, "--out", "policy"], cwd=folder, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    return PolicyFolder(folder / "policy")


def test_the_policy_sees_the_previous_command_and_no_linear_velocity(own_policy):
    names = {row["name"] for row in json.loads(own_policy.record_file.read_text())["observation"]}
    assert {"previous_command[t]", "previous_command[t-2]", "reference_joint_position[t+30]"} < names
    assert not any(name.startswith("linear_velocity_b") for name in names)


def test_tensorboard_shows_every_term(own_policy):
    events = EventAccumulator(str(own_policy.path))
    events.Reload()
    shown = {tag.removeprefix("Reward/") for tag in events.Tags()["scalars"] if tag.startswith("Reward/")}
    assert shown == set(TERMS)


def test_the_terms_are_what_the_file_says(own_policy, rng):
    record = own_policy.read_record()
    config = replace(record.preset.env, num_worlds=8)
    assert config.reward_names == TERMS
    assert dict(config.rewards[0].params) == {"exponent": 4.0}
    environment = ImitationEnvironment(own_policy.read_clips(record), config, "cpu")
    field = next(field for field in observation_layout(config) if field.name == "previous_command[t]")
    slips = []
    for _ in range(20):
        environment.action.assign(np.float32(rng.normal(0.0, 0.5, (8, 12))))
        environment.step()
        slips.append(environment.reward_terms.numpy()[:, 5])
        np.testing.assert_allclose(environment.reward_terms.numpy().sum(axis=1), environment.reward.numpy(), rtol=1e-5)
        goes_on = environment.episodes.done.numpy() == 0
        command = environment.motors.joint_target.numpy() - np.array(GO2.default_joint_position)
        seen = environment.observation.numpy()[:, field.start : field.stop]
        np.testing.assert_allclose(seen[goes_on], command[goes_on], atol=1e-6)
    assert np.min(slips) < 0.0
    assert np.max(slips) <= 0.0


def test_the_dataset_is_labelled_with_the_terms(own_policy, tmp_path):
    config = GatherConfig(trajectories=2, rows=20, warm_up=0.1, **ANYTHING_GOES)
    writer = DatasetWriter(tmp_path / "dataset.zarr", GO2)
    gather(own_policy, writer, config, "cpu")
    (motion,) = writer.motions()
    assert open_dataset(tmp_path / "dataset.zarr").motion(motion).labels("term") == TERMS


def test_a_base_below_the_files_height_ends_the_episode(own_policy, rng):
    record = own_policy.read_record()
    terms = with_limits(9.0, 9.0, record.preset.env.terminations)
    config = replace(record.preset.env, num_worlds=8, terminations=terms)
    assert config.reason_names[-1] == "base_low"
    environment = ImitationEnvironment(own_policy.read_clips(record), config, "cpu")
    seen = set()
    for _ in range(60):
        environment.action.assign(np.float32(rng.normal(0.0, 6.0, (8, 12))))
        joint_q = environment.robot.joint_q.numpy()
        joint_q[3, 2] = 0.1
        environment.robot.joint_q.assign(joint_q)
        environment.step()
        seen |= {config.reason_names[reason] for reason in environment.episodes.reason.numpy()}
    assert "base_low" in seen


def test_all_motors_of_a_robot_are_as_weak_as_its_battery(own_policy):
    record = own_policy.read_record()
    config = replace(record.preset.env, num_worlds=64)
    strength = ImitationEnvironment(own_policy.read_clips(record), config, "cpu").randomization.parameters()["strength"]
    np.testing.assert_array_equal(strength, np.tile(strength[:, :1], (1, 12)))
    assert len(np.unique(strength)) == 64
    assert 0.8 <= strength.min() < 0.82
    assert 0.98 < strength.max() <= 1.0


def test_rollouts_are_rejected_for_the_files_reason(own_policy, tmp_path):
    preset = own_policy.read_record().preset
    terms = with_term(preset.env.terminations, "base_low", min_height=9.0)
    record = replace(own_policy.read_record(), preset=replace(preset, env=replace(preset.env, terminations=terms)))
    copy = PolicyFolder(Path(shutil.copytree(own_policy.path, tmp_path / "policy")))
    copy.write_record(record)
    config = GatherConfig(trajectories=2, rows=20, warm_up=0.1, max_attempts=1.0, **ANYTHING_GOES)
    with pytest.raises(DatasetError, match="base_low"):
        gather(copy, DatasetWriter(tmp_path / "dataset.zarr", GO2), config, "cpu")
