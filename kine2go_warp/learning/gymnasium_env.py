"""The environment as Gymnasium's ``VectorEnv``: NumPy arrays, with the ends of episodes told apart."""

from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from kine2go_warp.learning.vec_env import ImitationVecEnv

if TYPE_CHECKING:
    import torch

Array = NDArray[np.float32]


class GymnasiumVectorEnv(gymnasium.vector.VectorEnv[Array, Array, Array]):
    """A view of an environment that ``make_env`` has made; both step the same worlds.

    A world that is done begins its next episode within the same step, and the observation returned is the first of
    the new episode (``AutoresetMode.SAME_STEP``). The last observation of the old one is not kept, so ``infos`` has no
    ``final_obs``. ``infos`` has the means of the reward terms as ``Reward/TERM``
    and the share of worlds that ended by each reason as ``Termination/TERM``, shape [num_envs], all equal.
    """

    def __init__(self, env: ImitationVecEnv) -> None:
        self.env = env
        self.num_envs = env.num_envs
        self.metadata = {"autoreset_mode": AutoresetMode.SAME_STEP, "render_fps": env.config.control_rate}
        size = env.buffers.observation.shape[1]
        self.single_observation_space = unbounded(size)
        self.single_action_space = unbounded(env.num_actions)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Begin an episode in every world, and return the observations, shape [num_envs, num_observations].

        Args:
            seed: Of all worlds; the same one gives the same episodes. By default the next number of ``np_random``.
            options: There are none.
        """
        super().reset(seed=seed, options=options)
        drawn = int(self.np_random.integers(2**31)) if seed is None else seed
        self.env.environment.restart(drawn)
        return self._observations(), {}

    def step(self, actions: Array) -> tuple[Array, Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Advance all worlds by one control step.

        Args:
            actions: What a policy puts out, shape [num_envs, 12].

        Returns:
            Observations of shape [num_envs, num_observations], and rewards, terminations (falls, faults), truncations
            (the time is up) of shape [num_envs], and the infos.
        """
        import torch

        chosen = torch.as_tensor(np.asarray(actions, np.float32), device=self.env.device)
        _, reward, done, extras = self.env.step(chosen)
        ended, truncated = in_numpy(done).astype(bool), in_numpy(extras["time_outs"]).astype(bool)
        infos = {name: np.full(self.num_envs, float(mean), np.float32) for name, mean in extras["log"].items()}
        return self._observations(), in_numpy(reward), ended & ~truncated, truncated, infos

    def close_extras(self, **_: Any) -> None:
        """Close the environment."""
        self.env.close()

    def _observations(self) -> Array:
        return in_numpy(self.env.buffers.observation)


def unbounded(size: int) -> gymnasium.spaces.Box:
    """Return the space of all vectors of a size."""
    return gymnasium.spaces.Box(-np.inf, np.inf, (size,), np.float32)


def in_numpy(tensor: "torch.Tensor") -> NDArray[Any]:
    """Return a copy in this machine's memory."""
    return tensor.detach().cpu().numpy().copy()
