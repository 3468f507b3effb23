import numpy as np
import torch
import warp as wp

from kine2go_warp.learning.vec_env import ImitationVecEnv


def test_what_a_step_returns_is_not_overwritten_by_the_next(environment):
    env = ImitationVecEnv(environment)
    _, reward, done, extras = env.step(torch.zeros(env.num_envs, 12))
    returned = (reward, done, extras["time_outs"])
    kept = [values.clone() for values in returned]
    np.testing.assert_array_equal(reward, environment.reward.numpy())
    _, second, *_ = env.step(torch.ones(env.num_envs, 12))
    assert all(torch.equal(values, before) for values, before in zip(returned, kept, strict=True))
    assert not torch.equal(second, reward)


def test_an_observation_is_not_overwritten_by_the_next_step(environment):
    env = ImitationVecEnv(environment)
    first = env.get_observations()
    kept = first["policy"].clone()
    second, *_ = env.step(torch.ones(env.num_envs, 12))
    assert torch.equal(first["policy"], kept)
    assert not torch.equal(second["policy"], kept)


def test_assigning_episode_lengths_reaches_the_graph(environment):
    env = ImitationVecEnv(environment)
    env.episode_length_buf = torch.full((env.num_envs,), int(env.max_episode_length) - 1)
    *_, extras = env.step(torch.zeros(env.num_envs, 12))
    assert bool(extras["time_outs"].all())
    ends = {name: float(value) for name, value in extras["log"].items() if name.startswith("Termination/")}
    assert ends.pop("Termination/time_out") == 1.0
    assert set(ends.values()) == {0.0}
    assert int(wp.to_torch(environment.episodes.length).max()) == 0
