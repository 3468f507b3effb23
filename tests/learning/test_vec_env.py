import torch
import warp as wp

from kine2go_warp.learning.vec_env import ImitationVecEnv


def test_tensors_share_their_memory_with_the_environment(environment):
    env = ImitationVecEnv(environment)
    _, reward, done, extras = env.step(torch.zeros(env.num_envs, 12))
    assert reward.data_ptr() == environment.reward.ptr
    assert done.data_ptr() == environment.episodes.done.ptr
    assert extras["time_outs"].data_ptr() == environment.episodes.time_out.ptr


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
    assert int(wp.to_torch(environment.episodes.length).max()) == 0
