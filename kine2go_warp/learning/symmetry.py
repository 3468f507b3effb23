"""Left for right: every sample of a symmetric robot on flat ground has a mirror image that is as true.

The reference is part of what the policy observes and is mirrored with the rest, so that no clip needs to be symmetric.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache

import torch
from tensordict import TensorDict

from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.observations import PlacedTerm, place_privileged, place_terms
from kine2go_warp.learning.vec_env import BufferedVecEnv
from kine2go_warp.quantities import mirrored


class Mirrored:
    """Mirrors vectors of one layout."""

    def __init__(self, places: Sequence[int], signs: Sequence[float]) -> None:
        self.places, self.signs = torch.tensor(places), torch.tensor(signs)

    @classmethod
    def of(cls, layout: Sequence[PlacedTerm]) -> "Mirrored":
        """Mirror vectors of an observation's layout."""
        places: list[int] = []
        signs: list[float] = []
        for placed in layout:
            offsets, term_signs = mirrored(placed.term.dims, placed.term.mirror)
            places += [placed.start + offset for offset in offsets]
            signs += term_signs
        return cls(places, signs)

    def __call__(self, values: torch.Tensor) -> torch.Tensor:
        """Return the mirror image of vectors along the last axis."""
        return values[..., self.places.to(values.device)] * self.signs.to(values.device)


@lru_cache
def make_mirrors(config: EnvConfig) -> dict[str, Callable[[torch.Tensor], torch.Tensor]]:
    """Return what mirrors the policy's and the critic's observations."""
    return {"policy": Mirrored.of(place_terms(config)), "privileged": Mirrored.of(place_privileged(config))}


mirrored_action = Mirrored(*mirrored(("joint",), "angle"))
"""Mirrors the action of the policy."""


def with_mirrored(
    env: BufferedVecEnv, obs: TensorDict | None, actions: torch.Tensor | None
) -> tuple[TensorDict | None, torch.Tensor | None]:
    """Return observations and actions followed by their mirror images, as RSL-RL's symmetry extension wants them."""
    both_actions = None if actions is None else torch.cat([actions, mirrored_action(actions)])
    if obs is None:
        return None, both_actions
    mirrors = make_mirrors(env.config)
    both = {name: torch.cat([obs[name], mirrors[name](obs[name])]) for name in map(str, obs.keys())}
    return TensorDict(both, batch_size=[2 * len(obs)]), both_actions  # pyright: ignore[reportArgumentType]
