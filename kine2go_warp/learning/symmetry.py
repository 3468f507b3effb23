"""Left for right: every sample of a symmetric robot on flat ground has a mirror image that is as true.

The reference is part of what the policy observes and is mirrored with the rest, so that no clip needs to be symmetric.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache

import torch
from tensordict import TensorDict

from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.observations import ObservationField, observation_layout, privileged_layout
from kine2go_warp.learning.vec_env import BufferedVecEnv

Mirror = tuple[tuple[int, ...], tuple[float, ...]]
"""For each value of a field, the place of its mirror image, and the sign that it takes."""

ARROW: Mirror = ((0, 1, 2), (1.0, -1.0, 1.0))
"""A direction or a velocity; y points left."""
TURN: Mirror = ((0, 1, 2), (-1.0, 1.0, -1.0))
"""An angular velocity; also the left axis of a frame, which is its rotation's and not an arrow of its own."""
OTHER_LEGS = (3, 4, 5, 0, 1, 2, 9, 10, 11, 6, 7, 8)
"""Joints of the legs FR, FL, RR, RL."""
ANGLES: Mirror = (OTHER_LEGS, (-1.0, 1.0, 1.0) * 4)
"""Positions and velocities of joints: hips turn about x, so their sign changes."""
FACTORS: Mirror = (OTHER_LEGS, (1.0,) * 12)
"""One number a joint that does not depend on its direction."""
FORCES: Mirror = (OTHER_LEGS, (1.0, -1.0, 1.0) * 4)
"""One arrow a foot."""
NUMBER: Mirror = ((0,), (1.0,))

MIRRORS: dict[str, Mirror] = {
    "down_b": ARROW,
    "linear_velocity_b": ARROW,
    "angular_velocity_b": TURN,
    "joint_position": ANGLES,
    "joint_velocity": ANGLES,
    "last_output": ANGLES,
    "target_position_h": ARROW,
    "target_forward_h": ARROW,
    "target_left_h": TURN,
    "target_joint_position": ANGLES,
    "root_height": NUMBER,
    "linear_velocity_h": ARROW,
    "angular_velocity_h": TURN,
    "foot_force_h": FORCES,
    "base_mass": NUMBER,
    "base_com": ARROW,
    "friction": NUMBER,
    "stiffness": FACTORS,
    "damping": FACTORS,
    "strength": FACTORS,
    "motor_offset": ANGLES,
    "latency": NUMBER,
}
"""How each field of the observation is mirrored, by its name without the instant."""


class Mirrored:
    """Mirrors vectors of one layout."""

    def __init__(self, places: Sequence[int], signs: Sequence[float]) -> None:
        self.places, self.signs = torch.tensor(places), torch.tensor(signs)

    @classmethod
    def of(cls, layout: Sequence[ObservationField]) -> "Mirrored":
        """Mirror vectors of an observation's layout."""
        places: list[int] = []
        signs: list[float] = []
        for field in layout:
            offsets, field_signs = MIRRORS[field.name.partition("[")[0]]
            places += [field.start + offset for offset in offsets]
            signs += field_signs
        return cls(places, signs)

    def __call__(self, values: torch.Tensor) -> torch.Tensor:
        """Return the mirror image of vectors along the last axis."""
        return values[..., self.places.to(values.device)] * self.signs.to(values.device)


@lru_cache
def mirrors_of(config: EnvConfig) -> dict[str, Callable[[torch.Tensor], torch.Tensor]]:
    """Return what mirrors the policy's and the critic's observations."""
    return {"policy": Mirrored.of(observation_layout(config)), "privileged": Mirrored.of(privileged_layout())}


mirrored_output = Mirrored(*ANGLES)
"""Mirrors the output of the policy."""


def with_mirrored(
    env: BufferedVecEnv, obs: TensorDict | None, actions: torch.Tensor | None
) -> tuple[TensorDict | None, torch.Tensor | None]:
    """Return observations and outputs followed by their mirror images, as RSL-RL's symmetry extension wants them."""
    both_outputs = None if actions is None else torch.cat([actions, mirrored_output(actions)])
    if obs is None:
        return None, both_outputs
    mirrors = mirrors_of(env.config)
    both = {name: torch.cat([obs[name], mirrors[name](obs[name])]) for name in map(str, obs.keys())}
    return TensorDict(both, batch_size=[2 * len(obs)]), both_outputs  # pyright: ignore[reportArgumentType]
