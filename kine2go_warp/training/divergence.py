"""Noticing that a training has broken down, early enough to begin again."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import torch
from torch import nn

from kine2go_warp.errors import TrainingDiverged

COLLAPSED_SHARE = 0.25
"""Episodes shorter than this share of the longest so far are a collapse, if they stay so."""

COLLAPSED_ITERATIONS = 10
"""Iterations in a row for which they must."""

WARM_UP = 20
"""Iterations before which episodes may be of any length."""


@dataclass
class DivergenceWatch:
    """Looks at each iteration and raises ``TrainingDiverged``.

    A training has diverged if

    - a loss, the mean reward, a weight or a statistic of a normaliser is not a finite number, or
    - the mean length of the last 100 episodes has been below a quarter of its best for ten iterations in a row, the
      first twenty iterations aside.

    In 14 healthy trainings of ``fast`` and its variants (40 to 120 iterations, trots and a horse's walk) the length
    never fell below 0.78 of its best, so a quarter leaves room for exploration.
    """

    best_length: float = 0.0
    """Longest mean length of episodes so far [control steps]."""
    collapsed_for: int = 0
    """Iterations in a row in which episodes have been short."""

    def check(
        self,
        iteration: int,
        losses: dict[str, float],
        reward: float,
        episode_length: float,
        models: Iterable[nn.Module] = (),
    ) -> None:
        """Look at one iteration.

        Args:
            iteration: Iterations done.
            losses: By name.
            reward: Mean reward of the last episodes.
            episode_length: Their mean length [control steps]; NaN before the first one ends, as the reward is.
            models: Whose weights must be finite.

        Raises:
            TrainingDiverged: the training has broken down.
        """
        has_ended = not math.isnan(episode_length)
        values = {f"the loss '{name}'": value for name, value in losses.items()}
        values |= {"the mean reward": reward} if has_ended else {}
        for name, value in values.items():
            if not math.isfinite(value):
                raise TrainingDiverged(f"iteration {iteration}: {name} is {value}")
        if not all_finite(models):
            raise TrainingDiverged(f"iteration {iteration}: a weight of the networks is not finite")
        if has_ended:
            self._check_length(iteration, episode_length)

    def _check_length(self, iteration: int, episode_length: float) -> None:
        """Count for how long episodes have been short."""
        self.best_length = max(self.best_length, episode_length)
        is_short = iteration > WARM_UP and episode_length < COLLAPSED_SHARE * self.best_length
        self.collapsed_for = self.collapsed_for + 1 if is_short else 0
        if self.collapsed_for >= COLLAPSED_ITERATIONS:
            raise TrainingDiverged(
                f"iteration {iteration}: episodes have lasted {episode_length:.0f} steps or so for "
                f"{COLLAPSED_ITERATIONS} iterations, after {self.best_length:.0f} at best"
            )


def all_finite(models: Iterable[nn.Module]) -> bool:
    """Return whether all weights and statistics are finite. It waits for the device once."""
    sums = [
        values.sum() for model in models for values in model.state_dict().values() if torch.is_floating_point(values)
    ]
    return not sums or bool(torch.stack(sums).isfinite().all())
