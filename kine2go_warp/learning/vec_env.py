"""The environment as RSL-RL wants it: torch tensors that share their memory with Warp's arrays."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
import warp as wp
from rsl_rl.env import VecEnv
from tensordict import TensorDict

from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.faults import StrictStepper, fault_counts
from kine2go_warp.env.snapshot import EnvironmentSnapshot

if TYPE_CHECKING:
    from collections.abc import Callable


def share_stream(device: str) -> None:
    """Make torch launch on Warp's stream, so that neither reads what the other has not written yet.

    Call it before the environment is built. Warp's stream is ordered with the default stream, on which Warp frees
    memory; torch's own streams are not.
    """
    if device.startswith("cuda"):
        torch.cuda.set_stream(wp.stream_to_torch(wp.get_device(device)))


@dataclass(frozen=True)
class StepBuffers:
    """What goes into a step and what comes out of it, the first axis being the world."""

    action: torch.Tensor
    observation: torch.Tensor
    privileged: torch.Tensor
    reward: torch.Tensor
    reward_terms: torch.Tensor
    done: torch.Tensor
    time_out: torch.Tensor
    episode_length: torch.Tensor
    reason: torch.Tensor

    @classmethod
    def views_of(cls, environment: ImitationEnvironment) -> "StepBuffers":
        """Return tensors that share their memory with an environment's arrays."""
        episodes = environment.episodes
        arrays = (
            environment.action,
            environment.observation,
            environment.privileged_observation,
            environment.reward,
            environment.reward_terms,
            episodes.done,
            episodes.time_out,
            episodes.length,
            episodes.reason,
        )
        return cls(*(wp.to_torch(array) for array in arrays))

    def rows(self, first: int, count: int) -> "StepBuffers":
        """Return views of some of the worlds."""
        return StepBuffers(*(getattr(self, field.name)[first : first + count] for field in fields(self)))

    def copy_results(self, source: "StepBuffers") -> None:
        """Copy all of them."""
        for field in fields(self):
            getattr(self, field.name).copy_(getattr(source, field.name))


class BufferedVecEnv(VecEnv):
    """A vectorised environment over step buffers, however they are filled."""

    def __init__(self, config: EnvConfig, num_actions: int, device: str, buffers: StepBuffers) -> None:
        self.num_envs = config.num_worlds
        self.num_actions = num_actions
        self.max_episode_length = config.max_episode_length
        self.device = device
        self.cfg = config
        self.config = config
        self.buffers = buffers
        self._reasons = torch.arange(1, len(config.reason_names), device=device)
        self.on_step: Callable[[], None] | None = None
        """Called after each control step."""

    @property
    def environment(self) -> ImitationEnvironment:
        """The worlds that this process simulates, all or the first ones."""
        raise NotImplementedError

    def advance(self) -> None:
        """Step all worlds, from ``buffers.action`` to the other buffers."""
        raise NotImplementedError

    def snapshot(self) -> EnvironmentSnapshot:
        """Return all that the worlds need to go on exactly."""
        raise NotImplementedError

    def restore(self, snapshot: EnvironmentSnapshot) -> None:
        """Put all worlds back to where a snapshot was taken."""
        raise NotImplementedError

    def fault_count(self) -> int:
        """Return how many worlds the simulation itself has failed so far."""
        raise NotImplementedError

    def close(self) -> None:
        """Give back what must be given back."""

    @property
    def episode_length_buf(self) -> torch.Tensor:  # type: ignore[override]
        """Control steps since the episode began, shape [num_worlds]."""
        return self.buffers.episode_length

    @episode_length_buf.setter
    def episode_length_buf(self, value: torch.Tensor) -> None:
        # RSL-RL assigns a new tensor to spread the time-outs; the captured graph keeps reading the old address.
        self.buffers.episode_length.copy_(value)

    def get_observations(self) -> TensorDict:
        """Return the present observation.

        A copy: RSL-RL stores the tensor only after the next step, which overwrites the environment's buffer.
        """
        observations = {"policy": self.buffers.observation.clone()}
        if self.config.privileged:
            observations["privileged"] = self.buffers.privileged.clone()
        return TensorDict(observations, batch_size=[self.num_envs])  # pyright: ignore[reportArgumentType]

    def step(self, actions: torch.Tensor) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict[str, Any]]:
        """Advance all worlds by one control step; see ``VecEnv.step``. What it returns are copies.

        The log has the mean of each reward term, and by reason the share of the worlds whose episode has ended.
        """
        buffers = self.buffers
        buffers.action.copy_(actions)
        self.advance()
        if self.on_step is not None:
            self.on_step()
        terms = buffers.reward_terms.mean(dim=0)
        log = {f"Reward/{name}": terms[index] for index, name in enumerate(self.config.reward_names)}
        ends = (buffers.reason[:, None] == self._reasons).float().mean(dim=0)
        log |= {f"Termination/{name}": ends[index] for index, name in enumerate(self.config.reason_names[1:])}
        extras = {"time_outs": buffers.time_out.clone(), "log": log}
        return self.get_observations(), buffers.reward.clone(), buffers.done.clone(), extras


class ImitationVecEnv(BufferedVecEnv):
    """One ``ImitationEnvironment`` in this process."""

    def __init__(self, environment: ImitationEnvironment, fault_folder: Path | None = None) -> None:
        """Adapt an environment.

        Args:
            environment: The environment.
            fault_folder: If given, stop at the first fault of the simulation and save its state here.
        """
        device = str(wp.device_to_torch(environment.device))
        super().__init__(environment.config, environment.num_joints, device, StepBuffers.views_of(environment))
        self._environment = environment
        stepper = environment if fault_folder is None else StrictStepper(environment, fault_folder)
        self._step = stepper.step

    @property
    def environment(self) -> ImitationEnvironment:
        """All worlds."""
        return self._environment

    def advance(self) -> None:
        """Step all worlds."""
        self._step()

    def snapshot(self) -> EnvironmentSnapshot:
        """Return all that the worlds need to go on exactly. It waits for the device."""
        return EnvironmentSnapshot.take(self.environment)

    def restore(self, snapshot: EnvironmentSnapshot) -> None:
        """Put all worlds back to where a snapshot was taken."""
        (own,) = snapshot.split([self.num_envs])
        own.restore(self.environment)

    def fault_count(self) -> int:
        """Return how many worlds the simulation itself has failed so far. It waits for the device."""
        return sum(fault_counts(self.environment).values())
