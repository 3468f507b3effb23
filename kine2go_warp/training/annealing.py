"""What changes while a policy learns: less is explored towards the end."""

import torch
from rsl_rl.algorithms import PPO

from kine2go_warp.learning.presets import PpoConfig


def anneal(algorithm: PPO, config: PpoConfig, iteration: int) -> None:
    """Set the entropy coefficient, and limit the noise, for the iteration after so many.

    They depend on the number of the iteration alone, not on how many are wanted, so that a training which is continued
    for longer goes on as if it had been asked for more at first.
    """
    if config.final_entropy_coef is not None:
        algorithm.entropy_coef = annealed(
            config.entropy_coef, config.final_entropy_coef, iteration, config.annealing_iterations
        )
    if config.final_std is not None:
        limit = annealed(config.init_std, config.final_std, iteration, config.annealing_iterations)
        with torch.no_grad():
            algorithm.actor.get_parameter("distribution.std_param").clamp_(max=limit)


def annealed(start: float, end: float, iteration: int, duration: int) -> float:
    """Return a value on its way from one to another, where it stays."""
    return start + (end - start) * min(iteration / duration, 1.0)
