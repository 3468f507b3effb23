"""Comparing variants of training: what is read, what runs, what is kept, and what the table says of it."""

import json

import pytest

from kine2go_warp.cli.main import main
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.evaluation import ablation
from kine2go_warp.evaluation.ablation import (
    BUNDLED,
    DETERMINISTIC,
    STOCHASTIC,
    AblationConfig,
    ablation_table,
    load_variants,
    run_trial,
    trials,
)
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.learning.presets import FAST
from kine2go_warp.settings import to_dictionary

SMALL = AblationConfig(steps=16 * 24 * 2, seeds=2, rollouts=2)


def flat(settings, path=""):
    """Settings as a dictionary of paths."""
    if not isinstance(settings, dict):
        return {path: settings}
    return {key: value for name in settings for key, value in flat(settings[name], f"{path}.{name}").items()}


def test_every_bundled_variant_changes_something_and_the_first_is_the_preset_itself():
    first, *others = load_variants(BUNDLED)
    assert first.preset == FAST.override({"env.num_worlds": 256})
    before = flat(to_dictionary(first.preset))
    changed = [
        {path for path, value in flat(to_dictionary(one.preset)).items() if before[path] != value} for one in others
    ]
    assert all(changed)
    assert len(others) == len({json.dumps(to_dictionary(one.preset)) for one in others}) == 23


@pytest.mark.parametrize("device", ["cpu", "cuda:0"])
def test_every_training_has_the_same_number_of_steps(device):
    config = AblationConfig()
    for variant in load_variants(BUNDLED):
        preset = config.preset(variant, 2, device)
        assert preset.env.num_worlds * preset.ppo.num_steps_per_env * preset.ppo.iterations == config.steps
        assert preset.env.seed == 2


def test_a_training_may_end_at_the_targets_of_its_preset():
    (fast,) = load_variants(BUNDLED, ["fast"])
    assert AblationConfig(until_targets=True).preset(fast, 1, "cpu").stopping == FAST.stopping
    assert AblationConfig().preset(fast, 1, "cpu").stopping.interval == 0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("preset = 'fast'", "names no variants"),
        ("preset = 'quick'\n[variants.a]\nabout = 'b'", "unknown preset 'quick'"),
        ("[variants.a]\nenv.motor.stifness = 4", r"line 2.*unknown key 'env.motor.stifness'; near ones"),
        ("[variants.a]\nppo.gamma = 2", "gamma is 2.0; it must be from 0 to 1"),
    ],
)
def test_a_wrong_file_is_refused_with_what_is_wrong(tmp_path, text, message):
    (tmp_path / "own.toml").write_text(text)
    with pytest.raises(Kine2GoError, match=message):
        load_variants(tmp_path / "own.toml")


def test_an_unknown_variant_is_refused_with_those_that_there_are():
    with pytest.raises(Kine2GoError, match="unknown variant 'fats'; known are: fast, default_pose"):
        load_variants(BUNDLED, ["fats"])


def write(out, variant, seed, tracked, joint_rmse):
    folder = out / "trot" / variant / f"seed-{seed}"
    folder.mkdir(parents=True)
    values = {"tracked": tracked, "survival": 1.0}
    values |= {} if joint_rmse is None else {"joint_rmse": joint_rmse}
    made = {"iterations": 40, "core_seconds": 8.0 + seed, "stopped": "targets reached" if seed == 1 else "budget"}
    result = {"variant": variant, **made, DETERMINISTIC: values, STOCHASTIC: {"survival": 0.5}}
    (folder / "ablation.json").write_text(json.dumps(result))


def test_the_table_shows_medians_over_seeds_and_the_spread_of_what_was_tracked(tmp_path):
    for seed, (tracked, rmse) in enumerate([(0.5, 0.03), (0.9, 0.02), (0.6, None)], start=1):
        write(tmp_path, "fast", seed, tracked, rmse)
    write(tmp_path, "symmetry", 1, 0.2, 0.1)
    lines = ablation_table("trot", load_variants(BUNDLED), tmp_path).splitlines()
    cells = [[cell.strip() for cell in line.split("|")][1:-1] for line in lines[4:]]
    assert lines[0] == "`trot`"
    assert cells[0][:5] == ["`fast`", "60.0 (50.0 to 90.0)", "100", "50.0", "0.025"]
    assert cells[0][-4:] == ["40.0", "10.0 (9.0 to 11.0)", "1", "3"]
    assert [row[0] for row in cells] == ["`fast`", "`symmetry`"]


def test_a_trial_trains_and_evaluates_once(clip, tmp_path, monkeypatch):
    own = tmp_path / "own.toml"
    own.write_text("[base]\nenv.num_worlds = 16\n[variants.stiff]\nenv.motor.stiffness = 90")
    config = AblationConfig(steps=16 * 24 * 2, seeds=1, rollouts=2)
    (trial,) = trials([clip], load_variants(own), config, tmp_path / "out")
    assert trial.label == "dog_trot stiff seed 1"
    run_trial(trial, config, "cpu", processes=1)
    record = trial.policy.read_record()
    assert (record.iterations, record.preset.env.motor.stiffness) == (2, 90.0)
    found = json.loads((tmp_path / "out/dog_trot/stiff/seed-1/ablation.json").read_text())
    assert 0.0 < found[DETERMINISTIC]["tracked"] < 0.2, "it falls soon"
    assert found[STOCHASTIC]["action_rate"] > found[DETERMINISTIC]["action_rate"]
    monkeypatch.setattr("kine2go_warp.evaluation.evaluate.evaluate", lambda *_: pytest.fail("done already"))
    run_trial(trial, config, "cpu", processes=1)


def test_the_command_prints_the_table_of_what_there_is(clip, tmp_path, capsys):
    clip.save(tmp_path / "trot.npz")
    write(tmp_path, "fast", 1, 0.25, 0.03)
    (tmp_path / "trot").rename(tmp_path / clip.name)
    assert main(["ablate", str(tmp_path / "trot.npz"), "--table", "--out", str(tmp_path), "--variants", "fast"]) == 0
    assert "| `fast` | 25.0 |" in capsys.readouterr().out


def test_trials_go_variant_by_variant(clip, tmp_path):
    variants = load_variants(BUNDLED, ["fast", "symmetry"])
    found = list(trials([clip], variants, SMALL, tmp_path))
    assert [(one.variant.name, one.seed) for one in found] == [
        ("fast", 1),
        ("fast", 2),
        ("symmetry", 1),
        ("symmetry", 2),
    ]
    assert len({one.policy.path for one in found}) == 4
    assert ablation.read_result(PolicyFolder(tmp_path / "nothing")) is None
