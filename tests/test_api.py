"""The package as a library: names that load nothing heavy, and an environment that other code can step."""

import subprocess
import sys

import numpy as np
import pytest
import torch

import kine2go_warp as k2g
from kine2go_warp.errors import MissingExtraError
from kine2go_warp.extras import named_extras

NUM_WORLDS = 4


@pytest.fixture(scope="module")
def env(clip):
    return k2g.make_env(clip, k2g.presets.FAST.env, num_worlds=NUM_WORLDS, device="cpu")


def test_importing_the_package_loads_nothing_but_the_standard_library():
    script = """
import sys
before = set(sys.modules)
import kine2go_warp as k2g
assert "make_env" in dir(k2g)
loaded = {name.partition(".")[0] for name in set(sys.modules) - before} - set(sys.stdlib_module_names)
assert loaded == {"kine2go_warp"}, loaded
"""
    subprocess.run([sys.executable, "-c", script], check=True)


def test_every_public_name_exists():
    assert all(getattr(k2g, name) is not None for name in k2g.__all__)
    with pytest.raises(AttributeError, match="retargte"):
        k2g.retargte  # noqa: B018


@pytest.mark.parametrize(("module", "extra"), [("torch", "train"), ("rerun.urdf", "review"), ("placo", "retarget")])
def test_a_package_that_is_missing_is_named_with_its_extra(module, extra):
    with pytest.raises(MissingExtraError, match=rf"{module} is not installed.*kine2go-warp\[{extra}\]"), named_extras():
        raise ModuleNotFoundError(name=module)


def test_a_missing_module_that_is_no_dependency_is_left_as_it_is():
    with pytest.raises(ModuleNotFoundError, match="mine") as caught, named_extras():
        raise ModuleNotFoundError("mine", name="mine")
    assert not isinstance(caught.value, MissingExtraError)


def test_what_a_step_returns_does_not_change_with_the_next_one(env):
    env.environment.restart(1)
    kept = []
    for _ in range(3):
        observation, reward, done, extras = env.step(torch.zeros(NUM_WORLDS, env.num_actions))
        kept.append((observation["policy"], reward, done, extras["time_outs"]))
    addresses = [[part.data_ptr() for part in step] for step in kept]
    assert len({address for step in addresses for address in step}) == 12
    assert not torch.equal(kept[0][1], kept[1][1])


def test_the_gymnasium_view_steps_the_same_worlds(env):
    """Gymnasium has no checker for vector environments; its wrapper that counts episodes checks what it is given."""
    from gymnasium.vector import AutoresetMode
    from gymnasium.wrappers.vector import RecordEpisodeStatistics

    view = k2g.GymnasiumVectorEnv(env)
    assert view.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    counted = RecordEpisodeStatistics(view)
    first, _ = counted.reset(seed=3)
    again, _ = counted.reset(seed=3)
    other, _ = counted.reset(seed=4)
    assert first in view.observation_space
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)
    view.action_space.seed(1)
    ended = np.zeros(NUM_WORLDS, bool)
    for _ in range(60):
        before = env.buffers.observation.clone()
        observation, reward, terminated, truncated, infos = counted.step(view.action_space.sample())
        assert observation in view.observation_space
        assert reward.shape == terminated.shape == truncated.shape == (NUM_WORLDS,)
        assert not (terminated & truncated).any()
        assert not np.array_equal(before.numpy(), observation)
        np.testing.assert_array_equal(env.buffers.observation.numpy(), observation)
        assert infos["Reward/joint_position"].shape == (NUM_WORLDS,)
        ended |= terminated
    assert ended.any(), "random actions make robots fall"
