"""Settings of the training stage."""

from dataclasses import dataclass, replace
from typing import Literal

from kine2go_warp.errors import PolicyError
from kine2go_warp.learning.presets import Preset, preset_named

CUDA_WORLDS = 4096
"""Worlds of ``fast`` and ``robust`` on a GPU, which has room for many."""


@dataclass(frozen=True)
class TrainConfig:
    """Settings of the training stage."""

    preset: Literal["fast", "paper", "robust"] = "fast"
    num_worlds: int | None = None
    """Worlds simulated at once; by default the preset's on a CPU, and 4096 for ``fast`` and ``robust`` on a GPU."""
    iterations: int | None = None
    """PPO iterations; by default the preset's."""
    seed: int = 1
    terrain: Literal["flat", "waves", "steps", "slopes"] = "flat"
    """Ground to train on; the reference is lifted onto it."""

    def resolve(self, device: str) -> Preset:
        """Return the preset with all overrides."""
        preset = preset_named(self.preset)
        num_worlds = self.num_worlds
        if num_worlds is None:
            on_gpu = device.startswith("cuda") and self.preset != "paper"
            num_worlds = CUDA_WORLDS if on_gpu else preset.env.num_worlds
        iterations = preset.ppo.iterations if self.iterations is None else self.iterations
        if num_worlds < 1 or iterations < 1 or self.seed < 0:
            raise PolicyError("num-worlds and iterations must be at least 1, and the seed not negative")
        return Preset(
            env=replace(
                preset.env,
                num_worlds=num_worlds,
                seed=self.seed,
                terrain=replace(preset.env.terrain, kind=self.terrain),
            ),
            ppo=replace(preset.ppo, iterations=iterations),
        )
