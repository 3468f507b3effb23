import numpy as np
import pytest

from kine2go_warp.env.config import CPU_WORLDS, CUDA_WORLDS, ActionConfig
from kine2go_warp.env.terms.randomization import RANDOMIZATION
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.learning.presets import FAST, PAPER, ROBUST, Preset, find_preset
from kine2go_warp.settings import from_dictionary, to_dictionary


def test_the_paper_preset_is_the_papers_table():
    settings = PAPER.ppo.runner_settings(1)
    algorithm = settings["algorithm"]
    assert settings["actor"]["hidden_dims"] == settings["critic"]["hidden_dims"] == [512, 256, 128]
    assert settings["actor"]["activation"] == "elu"
    assert not settings["actor"]["obs_normalization"]
    assert settings["actor"]["distribution_cfg"]["init_std"] == 1.0
    assert (PAPER.ppo.iterations, settings["num_steps_per_env"], settings["save_interval"]) == (10_000, 24, 100)
    expected = {
        "learning_rate": 1e-3,
        "schedule": "adaptive",
        "clip_param": 0.2,
        "desired_kl": 0.01,
        "entropy_coef": 0.01,
        "value_loss_coef": 1.0,
        "use_clipped_value_loss": True,
        "max_grad_norm": 1.0,
        "num_learning_epochs": 5,
        "num_mini_batches": 4,
        "gamma": 0.99,
        "lam": 0.95,
    }
    assert {key: algorithm[key] for key in expected} == expected
    env = PAPER.env
    assert (env.num_worlds, env.seed, env.control_rate, env.substeps, env.episode_time) == (8192, 1, 60.0, 4, 20.0)
    assert env.action == ActionConfig(mode="default_offset", scale=0.25, clip=100.0, latency=0.02)
    assert env.history_length == 3
    weights = [term.weight for term in env.active_rewards]
    np.testing.assert_allclose(np.array(weights) / 60.0, [0.008333, 0.000833, 0.003333, 0.0025, 0.001667], atol=5e-7)
    assert "action_rate" not in env.reward_names
    assert not PAPER.ppo.symmetry
    assert (env.reset.reference_probability, env.reset.joint_position) == (0.9, 0.3)
    limits = {name: value for term in env.terminations for name, value in term.params}
    assert limits == {"max_distance": 1.0, "max_angle": 1.5708}
    assert not env.phase_sampling.is_weighted
    assert env.randomization == RANDOMIZATION


@pytest.mark.parametrize("preset", [PAPER, FAST, ROBUST])
def test_settings_survive_the_way_through_a_file(preset):
    assert from_dictionary(Preset, to_dictionary(preset), "policy.json") == preset


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"env": {"worlds": 3}}, "unknown key.*worlds"),
        ({"env": {"num_worlds": "many"}}, "env.num_worlds"),
        ({"env": {"action": {"mode": "torque"}}}, "env.action.mode"),
        ({"ppo": {"hidden_dims": [64, "x"]}}, "ppo.hidden_dims"),
    ],
)
def test_wrong_settings_are_named(values, message):
    with pytest.raises(Kine2GoError, match=message) as error:
        from_dictionary(Preset, values, "recipe.toml")
    assert str(error.value).startswith("recipe.toml: ")


def test_whole_numbers_may_stand_for_real_ones():
    preset = from_dictionary(Preset, {"env": {"motor": {"stiffness": 40}}}, "recipe.toml")
    assert preset.env.motor.stiffness == 40.0


def test_fast_takes_more_worlds_on_a_gpu_and_overrides_win():
    assert FAST.on("cpu").env.num_worlds == CPU_WORLDS == 256
    assert ROBUST.on("cuda:0").env.num_worlds == CUDA_WORLDS == 4096
    assert PAPER.on("cpu").env.num_worlds == PAPER.on("cuda:0").env.num_worlds == 8192
    resolved = FAST.override({"env.num_worlds": 7, "ppo.iterations": 2, "env.seed": 9}).on("cuda:0")
    assert (resolved.env.num_worlds, resolved.ppo.iterations, resolved.env.seed) == (7, 2, 9)
    np.testing.assert_equal(resolved.env.rewards, FAST.env.rewards)


def test_an_unknown_preset_is_named():
    with pytest.raises(Kine2GoError, match="unknown preset 'slow'; known are: paper, fast"):
        find_preset("slow")
