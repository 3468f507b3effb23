"""The settings of ``kine2go policy train``: presets of one's own, files, options, and what they are printed as."""

import pytest

from kine2go_warp.cli.main import main
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.learning.presets import ROBUST, find_preset
from kine2go_warp.pipelines.recipe import load_recipe

OWN = """
from dataclasses import replace
from kine2go_warp.learning.presets import FAST
PRESET = FAST.override({"env.motor.stiffness": 33, "ppo.gamma": 0.9})
OTHER = 3
"""


def printed(capsys, tmp_path, *arguments):
    """The settings that a command prints, read back from a recipe that holds them."""
    assert main(["train", "--print-config", *arguments]) == 0
    text = capsys.readouterr().out
    recipe = tmp_path / "printed.toml"
    recipe.write_text(f'name = "a"\nmotions = ["dog_trot"]\n{text}')
    return load_recipe(recipe).train


def test_options_replace_settings_of_the_preset(capsys, tmp_path):
    options = ["--preset", "robust", "--env.motor.stiffness", "40", "--ppo.entropy-coef", "0.01", "--iterations", "7"]
    expected = {"env.motor.stiffness": 40, "ppo.entropy_coef": 0.01, "ppo.iterations": 7}
    assert printed(capsys, tmp_path, *options) == ROBUST.override(expected)


def test_what_is_printed_can_be_given_back_and_replaced_again(capsys, tmp_path):
    first = printed(capsys, tmp_path, "--preset", "robust", "--ppo.final-std", "0.2")
    config = str(tmp_path / "printed.toml")
    assert printed(capsys, tmp_path, "--config", config) == first
    assert printed(capsys, tmp_path, "--config", config, "--seed", "5") == first.override({"env.seed": 5})


def test_a_preset_of_ones_own_comes_from_a_file(capsys, tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    found = printed(capsys, tmp_path, "--preset", f"{tmp_path / 'own.py'}:PRESET", "--ppo.lam", "0.8")
    assert (found.env.motor.stiffness, found.ppo.gamma, found.ppo.lam) == (33.0, 0.9, 0.8)
    assert find_preset(found.preset).ppo.gamma == 0.9


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--preset", "turbo"], "unknown preset 'turbo'; known are: paper, fast, robust"),
        (["--preset", "own.py:OTHER"], "own.py: 'OTHER' is no Preset"),
        (["--preset", "none.py:PRESET"], "none.py: no such"),
        (["--config", "wrong.toml"], "wrong.toml, line 3, [train.env.motor]: unknown key"),
        (["--config", "low.toml"], "low.toml, line 2, [train.ppo]: iterations is -2; it must be from 1 to"),
        (["--config", "none.toml"], "none.toml: no such file"),
        (["--config", "other.toml"], "other.toml: has no section [train]"),
        (["--iterations", "-2"], "iterations is -2; it must be from 1 to 1,000,000,000"),
        (["--env.motor.stiffness", "nan"], "'nan' is not finite"),
        (["--terrain", "holes"], "'env.terrain.kind' is \"holes\"; allowed are: flat, waves, steps, slopes"),
    ],
)  # fmt: skip
def test_wrong_settings_are_refused_in_one_line_that_says_what_is_right(
    capsys, tmp_path, monkeypatch, arguments, message
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text(OWN)
    (tmp_path / "other.toml").write_text("[trian.env]\nseed = 3\n")
    (tmp_path / "wrong.toml").write_text("\n[train.env.motor]\nstifness = 4\n")
    (tmp_path / "low.toml").write_text("[train.ppo]\niterations = -2\n")
    assert main(["train", "--print-config", *arguments]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert len(error.splitlines()) == 1


def test_clips_that_the_benchmark_holds_out_are_left_out_when_asked_for(clip, standing_clip, tmp_path, capsys):
    for one in (clip, standing_clip):
        one.save(tmp_path / f"{one.name}.npz")
    trot, standing = (str(tmp_path / f"{one.name}.npz") for one in (clip, standing_clip))
    options = ["--no-held-out", "--out", str(tmp_path / "policy"), "--iterations", "1", "--num-worlds", "8"]
    assert main(["train", trot, *options]) == 2
    assert "all of the clips are held out" in capsys.readouterr().err
    assert main(["train", trot, standing, *options, "--processes", "1", "--device", "cpu"]) == 0
    assert PolicyFolder(tmp_path / "policy").read_record().clips == ("standing.npz",)
