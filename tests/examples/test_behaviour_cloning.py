import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
import torch

from examples.behaviour_cloning import AHEAD, ARRAYS, HISTORY, NOW, WINDOW, Settings, main, observe, pushed, train
from kine2go_warp.dataset import load_rows, open_dataset
from kine2go_warp.dataset.torch_windows import WindowLoader
from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.env.config import ActionConfig
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.terms.base import find_term
from kine2go_warp.env.terms.randomization import randomized
from kine2go_warp.robots import GO2
from kine2go_warp.rollouts.collector import round_seeds
from kine2go_warp.rollouts.config import GatherConfig
from kine2go_warp.rollouts.gather import gather
from kine2go_warp.rollouts.worlds import environment_config
from kine2go_warp.rotations import to_rotation
from tests.conftest import ANYTHING_GOES

TINY = ("--batches", "20", "--batch-size", "64", "--hidden-layers", "32", "--worlds", "4", "--duration", "0.5")


@pytest.fixture(scope="module")
def windows(clean_dataset):
    """All windows of the dataset."""
    loader = WindowLoader(load_rows(open_dataset(clean_dataset), ARRAYS), WINDOW, batch_size=64, drop_last=False)
    return loader.gather(torch.from_numpy(loader.starts))


def test_what_the_clone_sees_in_the_dataset_is_what_the_environment_shows_it(policy, clip, tmp_path):
    """Rows are gathered from the very beginning, so that their actions repeat them in an environment of the clone."""
    config = GatherConfig(trajectories=4, rows=30, warm_up=0.0, max_attempts=1.0, **ANYTHING_GOES)
    assert gather(policy, DatasetWriter(tmp_path / "dataset.zarr", GO2), config, "cpu").accepted == 4
    dataset = open_dataset(tmp_path / "dataset.zarr")
    settings = environment_config(dataset.motion("dog_trot").attributes, "")
    action = ActionConfig("default_offset", GO2.action_scale, latency=settings.action.latency)
    settings = replace(settings, action=action, history_length=HISTORY, steps_ahead=AHEAD)
    environment = ImitationEnvironment([clip], settings, "cpu")
    environment.restart(round_seeds(config.seed, clip.name, 0)[0])

    rows = {
        name: torch.stack([torch.from_numpy(one.arrays[name]) for one in dataset.trajectories()]) for name in ARRAYS
    }
    for row in range(30 - max(AHEAD)):
        if row >= NOW:
            seen = observe({name: values[:, row - NOW : row - NOW + WINDOW] for name, values in rows.items()})
            np.testing.assert_allclose(seen, environment.observation.numpy(), atol=1e-4, err_msg=f"row {row}")
        environment.action.assign(rows["action"][:, row].numpy())
        environment.step()


def test_pushes_of_one_speed_leave_the_rest_but_for_the_limits(clean_dataset):
    config = environment_config(open_dataset(clean_dataset).motion("dog_trot").attributes, "")
    hard = pushed(config, 0.5)
    assert find_term(hard.randomization, "push_speed").range == (0.5, 0.5)
    assert find_term(hard.terminations, "distance").params == (("max_distance", 1.0),)
    assert find_term(hard.terminations, "rotation").params == (("max_angle", 1.0),)
    same = randomized(hard.randomization, push_speed=find_term(config.randomization, "push_speed").range)
    assert replace(hard, randomization=same, terminations=config.terminations) == config


def test_what_the_clone_sees_does_not_depend_on_place_or_heading(windows):
    turn, shift = to_rotation(np.array([np.cos(0.6), 0.0, 0.0, np.sin(0.6)])), torch.tensor([3.0, -5.0, 0.0])
    matrix = torch.from_numpy(turn.as_matrix()).float()
    moved = dict(windows)
    for name, values in windows.items():
        if name.endswith("root_position"):
            moved[name] = values @ matrix.T + shift
        elif name.endswith(("linear_velocity", "angular_velocity")):
            moved[name] = values @ matrix.T
        elif name.endswith("orientation"):
            flat = (turn * to_rotation(values.reshape(-1, 4).numpy())).as_quat(scalar_first=True)
            moved[name] = torch.from_numpy(flat).float().reshape(values.shape)
    assert not torch.allclose(moved["root_linear_velocity"], windows["root_linear_velocity"], atol=0.1)
    torch.testing.assert_close(observe(moved), observe(windows), atol=2e-5, rtol=0.0)


def test_the_clone_does_not_see_the_action_that_it_is_to_foretell(windows):
    later = dict(windows)
    for name in ("action", "action_mean"):
        later[name] = windows[name].clone()
        later[name][:, NOW:] += 1.0
    for name in ("joint_position", "joint_velocity", "root_linear_velocity", "root_angular_velocity"):
        later[name] = windows[name].clone()
        later[name][:, NOW + 1 :] += 1.0
    torch.testing.assert_close(observe(later), observe(windows), atol=0.0, rtol=0.0)


def test_a_short_training_lowers_the_loss_on_trajectories_it_has_not_seen(clean_dataset, tmp_path):
    settings = Settings(clean_dataset, tmp_path, batches=60, batch_size=64, hidden_layers=(64,))
    _, (before, after) = train(*open_dataset(clean_dataset).split(0.2), settings)
    assert after < 0.5 * before


def test_the_script_compares_the_clone_with_its_original(clean_dataset, policy, tmp_path, capsys):
    file = tmp_path / "figures.json"
    assert main([str(clean_dataset), str(policy.path), "--json", str(file), "--trajectories", "3", *TINY]) == 0
    printed = capsys.readouterr().out
    assert "3 trajectories, " in printed
    figures = json.loads(file.read_text())
    assert [one["policy"] for one in figures["policies"]] == ["original", "original with noise", "clone"]
    for one in figures["policies"]:
        share, low, high = one["survival"]
        assert one["rollouts"] == 4
        assert 0.0 <= low <= share <= high <= 1.0
        assert one["policy"] in printed


def test_a_policy_that_did_not_make_the_dataset_is_refused_in_one_line(clean_dataset, policy, tmp_path, capsys):
    other = shutil.copytree(policy.path, tmp_path / "other")
    checkpoint = torch.load(other / "model_2.pt", weights_only=True)
    next(iter(checkpoint["actor_state_dict"].values())).add_(1e-3)
    torch.save(checkpoint, other / "model_2.pt")
    assert main([str(clean_dataset), str(other), *TINY]) == 2
    message = capsys.readouterr().err
    assert "was not gathered from the policy" in message
    assert message.count("\n") == 1


def test_impossible_settings_are_refused_in_one_line(clean_dataset, policy, capsys):
    assert main([str(clean_dataset), str(policy.path), "--trajectories", "0"]) == 2
    assert main([str(clean_dataset), str(policy.path), "--batch-size", "100000"]) == 2
    first, second = capsys.readouterr().err.splitlines()
    assert "must be positive" in first
    assert "fewer than a batch of 100000" in second
