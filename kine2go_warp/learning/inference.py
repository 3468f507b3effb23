"""A trained policy that acts, with as much noise as wanted."""

import contextlib
import copy
import io
from pathlib import Path

import torch
from rsl_rl.models import MLPModel
from tensordict import TensorDict

from kine2go_warp.errors import PolicyError
from kine2go_warp.learning.checkpoint import acting_weights, load_checkpoint
from kine2go_warp.learning.presets import Preset
from kine2go_warp.learning.symmetry import make_mirrors, mirrored_action
from kine2go_warp.learning.vec_env import ImitationVecEnv


class NoisyPolicy:
    """The best policy of a checkpoint. Sampling has a generator of its own, so that a seed fixes the rollouts."""

    def __init__(self, env: ImitationVecEnv, preset: Preset, checkpoint: Path, seed: int) -> None:
        """Load the actor.

        Args:
            env: The environment that it acts in.
            preset: Settings that it was trained with.
            checkpoint: File of the weights.
            seed: Seed of the noise.
        """
        settings = preset.ppo.runner_settings(seed, preset.env.privileged)
        actor = copy.deepcopy(settings["actor"])
        actor.pop("class_name")
        weights = acting_weights(load_checkpoint(checkpoint, str(env.device)))
        with contextlib.redirect_stdout(io.StringIO()):
            model = MLPModel(env.get_observations(), settings["obs_groups"], "actor", env.num_actions, **actor)
        try:
            model.load_state_dict(weights)
        except RuntimeError as error:
            raise PolicyError(f"{checkpoint}: does not fit its settings ({str(error).splitlines()[0]})") from None
        self.model = model.to(env.device).eval()
        self.generator = torch.Generator(env.device).manual_seed(seed)
        self._mirror = make_mirrors(env.config)["policy"]
        self.vary(torch.zeros(1, 1), torch.zeros(1, 1))

    def vary(self, mirrored: torch.Tensor, persistence: torch.Tensor) -> None:
        """Choose how the policy acts in each world from now on.

        Args:
            mirrored: Where it sees the world and acts with left and right exchanged, not 0 there.
            persistence: Correlation of the noise with that of the control step before, in [0, 1). Both have shape
                [num_worlds, 1], or one value for all worlds.
        """
        device = self.generator.device
        self._mirrored = mirrored.to(device) != 0 if mirrored.any() else None
        self._persistence = persistence.to(device) if persistence.any() else None
        self._sample: torch.Tensor | None = None

    @torch.inference_mode()
    def __call__(self, observation: TensorDict, noise: torch.Tensor | float) -> tuple[torch.Tensor, torch.Tensor]:
        """Return mean and sampled output, each of shape [num_worlds, 12].

        Args:
            observation: What the policy sees.
            noise: Noise on the outputs, in standard deviations of the policy, shape [num_worlds, 1] or one for all.
        """
        if self._mirrored is not None:
            seen = observation["policy"]
            observation = TensorDict({"policy": torch.where(self._mirrored, self._mirror(seen), seen)}, len(seen))  # pyright: ignore[reportArgumentType]
        self.model(observation, stochastic_output=True)
        mean, deviation = self.model.output_distribution_params
        sample = torch.randn(mean.shape, generator=self.generator, device=mean.device)
        if self._persistence is not None:
            if self._sample is not None:
                # The variance stays 1.
                fresh = (1.0 - self._persistence.square()).sqrt()
                sample = self._persistence * self._sample + fresh * sample
            self._sample = sample
        action = mean + noise * deviation * sample
        if self._mirrored is not None:
            mean, action = (torch.where(self._mirrored, mirrored_action(one), one) for one in (mean, action))
        return mean, action

    @torch.inference_mode()
    def deviation(self, observation: TensorDict) -> torch.Tensor:
        """Return the standard deviations of the outputs, which no observation changes, shape [12]."""
        self.model(observation, stochastic_output=True)
        return self.model.output_distribution_params[1][0]
