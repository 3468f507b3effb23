"""The environment as RSL-RL wants it: torch tensors that share their memory with Warp's arrays."""

import torch
import warp as wp
from rsl_rl.env import VecEnv
from tensordict import TensorDict

from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.kernels.rewards import REWARD_TERMS


def share_stream(device: str) -> None:
    """Make Warp launch on the stream that torch uses, so that neither reads what the other has not written yet.

    Call it before the environment is built. Graphs cannot be captured on the default stream, hence a new one.
    """
    if device.startswith("cuda"):
        stream = torch.cuda.Stream(device)
        torch.cuda.set_stream(stream)
        wp.set_stream(wp.stream_from_torch(stream), device)


class ImitationVecEnv(VecEnv):
    """Adapts an ``ImitationEnvironment`` to RSL-RL."""

    def __init__(self, environment: ImitationEnvironment) -> None:
        self.environment = environment
        self.num_envs = environment.num_worlds
        self.num_actions = environment.num_joints
        self.max_episode_length = environment.config.max_episode_length
        self.device = str(wp.device_to_torch(environment.device))
        self.cfg = environment.config
        self._output = wp.to_torch(environment.output)
        self._observation = wp.to_torch(environment.observation)
        self._reward = wp.to_torch(environment.reward)
        self._reward_terms = wp.to_torch(environment.reward_terms)
        self._done = wp.to_torch(environment.episodes.done)
        self._time_out = wp.to_torch(environment.episodes.time_out)
        self._episode_length = wp.to_torch(environment.episodes.length)

    @property
    def episode_length_buf(self) -> torch.Tensor:  # type: ignore[override]
        """Control steps since the episode began, shape [num_worlds]; a view of the device's counter."""
        return self._episode_length

    @episode_length_buf.setter
    def episode_length_buf(self, value: torch.Tensor) -> None:
        # RSL-RL assigns a new tensor to spread the time-outs; the captured graph keeps reading the old address.
        self._episode_length.copy_(value)

    def get_observations(self) -> TensorDict:
        """Return the present observation.

        A copy: RSL-RL stores the tensor only after the next step, which overwrites the environment's buffer.
        """
        return TensorDict({"policy": self._observation.clone()}, batch_size=[self.num_envs])

    def step(self, actions: torch.Tensor) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict]:
        """Advance all worlds by one control step; see ``VecEnv.step``."""
        self._output.copy_(actions)
        self.environment.step()
        terms = self._reward_terms.mean(dim=0)
        log = {f"Reward/{name}": terms[index] for index, name in enumerate(REWARD_TERMS)}
        return self.get_observations(), self._reward, self._done, {"time_outs": self._time_out, "log": log}
