"""Comparing choices of training: what runs, what is kept, and what the table says of it."""

import itertools
import json
import math
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from kine2go_warp.bench import ablation
from kine2go_warp.bench.ablation import ablation_table, read_results, run_ablation, tasks
from kine2go_warp.bench.choices import CHOICES, AblationConfig, Choice
from kine2go_warp.bench.curves import band
from kine2go_warp.bench.trial import Figures, Trial, figures, run_trial
from kine2go_warp.cli.main import main
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.learning.presets import FAST, PRESETS
from kine2go_warp.settings import to_dictionary

FEW = (CHOICES[0], Choice("stiff", "stiffer motors", (("env.motor.stiffness", 90.0),)))
SMALL = AblationConfig(steps=256 * 24, seeds=2, rollouts=2)


def flat(settings, path=""):
    """Settings as a dictionary of paths."""
    if not isinstance(settings, dict):
        return {path: settings}
    return {key: value for name in settings for key, value in flat(settings[name], f"{path}.{name}").items()}


@pytest.mark.parametrize("choice", CHOICES[1:], ids=lambda choice: choice.name)
def test_a_choice_changes_what_it_says_and_nothing_else(choice):
    before, after = flat(to_dictionary(FAST)), flat(to_dictionary(choice.apply(FAST)))
    assert {f".{path}" for path, _ in choice.values} == {path for path in before if before[path] != after[path]}


def test_names_are_unique_and_the_first_is_the_preset_itself():
    assert len({choice.name for choice in CHOICES}) == len(CHOICES)
    assert CHOICES[0].apply(FAST) == FAST == PRESETS["fast"]
    with pytest.raises(Kine2GoError, match="unknown key"):
        FAST.override({"env.motor.colour": 1})


def test_every_training_has_the_same_number_of_steps():
    config = AblationConfig()
    for choice in CHOICES:
        preset = config.preset(choice, seed=2)
        assert preset.env.num_worlds * preset.ppo.num_steps_per_env * preset.ppo.iterations == config.steps
        assert preset.env.seed == 2


def a_trial(reward, survival=1.0):
    noise_free = Figures(survival, reward, 0.03, 0.04, 0.05, 0.001, 200.0)
    return Trial(noise_free, replace(noise_free, joint_rmse=math.nan), 10.0, 9.0, ())


def test_only_what_is_missing_runs_also_after_a_kill(clip, tmp_path, monkeypatch):
    results, run = tmp_path / "deep" / "results.jsonl", []
    monkeypatch.setattr(ablation, "run_trial", lambda *_: a_trial(0.5))
    wanted = list(tasks([clip], FEW, SMALL))
    assert [task.label for task in wanted][:3] == [
        "dog_trot fast seed 1",
        "dog_trot fast seed 2",
        "dog_trot stiff seed 1",
    ]

    def go():
        run.clear()
        run_ablation(wanted, SMALL, results, "cpu", lambda task: run.append(task.label), print)
        return len(run)

    assert go() == 4
    assert go() == 0
    results.write_text(results.read_text()[:-40])
    assert go() == 1, "the line that the kill cut short"
    assert len(read_results(results)) == 4
    results.write_text("{}\n" + results.read_text())
    with pytest.raises(Kine2GoError, match="line 1: not a result"):
        read_results(results)


def test_the_table_shows_medians_over_seeds_and_the_spread_of_the_reward(clip, tmp_path, monkeypatch):
    rewards = iter([0.5, 0.9, 0.6, 0.2, 0.4, 0.3])
    monkeypatch.setattr(ablation, "run_trial", lambda *_: a_trial(next(rewards)))
    config, results = replace(SMALL, seeds=3), tmp_path / "results.jsonl"
    run_ablation(tasks([clip], FEW, config), config, results, "cpu", lambda _: None, print)
    lines = ablation_table(read_results(results), FEW).splitlines()
    cells = [[cell.strip() for cell in line.split("|")] for line in lines]
    assert lines[0] == "`dog_trot`"
    assert cells[2][1:3] == ["choice", "reward [%]"]
    assert cells[4][1:6] == ["`fast`", "60.0 (50.0 to 90.0)", "100", "100", "0.030"]
    assert cells[5][1:3] == ["`stiff`", "30.0 (20.0 to 40.0)"]
    assert cells[5][-3:-1] == ["9", "3"]


def test_the_command_draws_a_panel_a_motion_and_a_line_a_choice(tmp_path, capsys):
    results, picture = tmp_path / "results.jsonl", tmp_path / "curves.png"
    lines = []
    for motion, name, seed in itertools.product(("trot", "walk"), ("fast", "symmetry"), (1, 2)):
        curve = [{"steps": 6144 * n, "seconds": 1.0, "reward": 0.1, "episode_length": 60.0 * n} for n in (1, 2, 3)]
        trial = to_dictionary(a_trial(0.1 * seed))
        lines.append({"key": f"{motion}{name}{seed}", "motion": motion, "choice": name, "seed": seed, **trial})
        lines[-1]["curve"] = curve[: 4 - seed]
    results.write_text("".join(json.dumps(line) + "\n" for line in lines))
    command = ["ablate", "--table", "--out", str(results), "--plot", str(picture), "--choices", "fast"]
    assert main(command) == 0
    output = capsys.readouterr().out
    assert "`walk`" in output
    assert "symmetry" not in output
    with Image.open(picture) as image:
        assert image.width > 500
        colours = {colour for _, colour in image.convert("RGB").getcolors(1 << 20)}
    assert (0x00, 0x72, 0xB2) in colours, "the line of the first choice"
    steps, lowest, middle, highest = band(lines[:2])
    np.testing.assert_allclose(steps, [6.144, 12.288])
    np.testing.assert_allclose([lowest, middle, highest], [[1.0, 2.0]] * 3)


def test_nothing_can_be_drawn_of_no_results(tmp_path, capsys):
    command = ["ablate", "--table", "--out", str(tmp_path / "none.jsonl"), "--plot", str(tmp_path / "curves.png")]
    assert main(command) == 2
    assert "no results" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_trial_trains_and_evaluates(clip):
    preset = replace(FAST, env=replace(FAST.env, num_worlds=16), ppo=replace(FAST.ppo, iterations=2))
    trial = run_trial(clip, preset, "cpu", rollouts=3)
    assert [point.steps for point in trial.curve] == [384, 768]
    assert 0.0 < trial.mean.reward < 0.2, "it falls soon"
    assert 0.0 < trial.mean.joint_rmse < 0.5
    assert trial.mean.survival == 0.0
    assert 1.0 < trial.mean.power < 1000.0
    assert trial.noisy.action_rate > trial.mean.action_rate
    json.dumps(to_dictionary(trial))


def test_figures_of_rollouts_that_are_known():
    """Two rollouts: one half a metre off in a single joint's place for 20 s, one that fails at once."""
    rows = {
        "joint_position": np.full((2, 1200, 12), 0.1),
        "joint_velocity": np.full((2, 1200, 12), 2.0),
        "reference_joint_position": np.zeros((2, 1200, 12)),
        "root_position": np.zeros((2, 1200, 3)),
        "reference_root_position": np.tile([0.0, 0.03, 0.04], (2, 1200, 1)),
        "root_orientation": np.tile([1.0, 0.0, 0.0, 0.0], (2, 1200, 1)),
        "reference_root_orientation": np.tile([1.0, 0.0, 0.0, 0.0], (2, 1200, 1)),
        "link_position": np.zeros((2, 1200, 16, 3)),
        "reference_foot_position": np.zeros((2, 1200, 4, 3)),
        "reward": np.tile(np.array([0.5, 0.05, 0.2, 0.3, 0.2]) / 60.0, (2, 1200, 1)),
        "joint_target": np.tile((np.arange(1200) % 2)[:, None] * 0.2, (2, 1, 12)),
        "joint_torque": np.full((2, 1200, 12), 3.0),
    }
    rows["joint_torque"][:, :600, 2] = 35.55
    for values in rows.values():
        values[1] = np.nan
    found = figures(rows, np.array([1200, 0]), FAST.env)
    assert found.survival == 0.5
    assert found.reward == pytest.approx(0.5)
    assert found.joint_rmse == pytest.approx(0.1)
    assert found.root_error == pytest.approx(0.05)
    assert found.action_rate == pytest.approx(0.2)
    assert found.torque_saturation == pytest.approx(0.5 / 12)
    assert found.power == pytest.approx(12 * 6.0 + 0.5 * 2.0 * (35.55 - 3.0))
