"""Everything that a world needs to go on exactly as it did: taken, saved, and put back."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.randomization import parameter_arrays
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.files import atomic_file


def world_arrays(environment: ImitationEnvironment) -> dict[str, wp.array[Any]]:
    """Return the arrays that decide a world's future, by name; the first axis of each is the world."""
    simulation, motors = environment.simulation, environment.motors
    episodes, randomization = environment.episodes, environment.randomization
    return {
        "joint_q": environment.robot.joint_q,
        "joint_qd": environment.robot.joint_qd,
        "warm_start": simulation.warm_start,
        "target_queue": motors.target_queue,
        "last_action": environment.last_action,
        **parameter_arrays(motors, randomization.bodies),
        "friction_anchor": motors.model.friction_anchor,
        "next_push": randomization.next_push,
        "seed": episodes.seed,
        "episode": episodes.episode,
        "reference_step": episodes.reference_step,
        "episode_length": episodes.length,
        "clip": episodes.placement.clip,
        "start_phase": episodes.placement.start_phase,
        "heading": episodes.placement.heading,
        "origin": episodes.placement.origin,
    }


@dataclass(frozen=True)
class WorldSnapshot:
    """The state of some worlds between two control steps."""

    arrays: dict[str, NDArray[Any]]
    """As in ``world_arrays``; the first axis of each is the world."""

    @classmethod
    def take(cls, environment: ImitationEnvironment) -> "WorldSnapshot":
        """Copy the state of all worlds to the host."""
        return cls({name: array.numpy().copy() for name, array in world_arrays(environment).items()})

    @property
    def num_worlds(self) -> int:
        """Number of worlds."""
        return len(self.arrays["joint_q"])

    def selected(self, which: NDArray[Any]) -> "WorldSnapshot":
        """Return some of the worlds, by index or mask."""
        return WorldSnapshot({name: array[which] for name, array in self.arrays.items()})

    def restore(self, environment: ImitationEnvironment) -> None:
        """Put the state back into an environment of as many worlds, which may be another one.

        The history of observations is not part of it: actions can be replayed, a policy sees its own past anew.

        Raises:
            Kine2GoError: the environment has another number of worlds, or another latency.
        """
        with wp.ScopedDevice(environment.device):
            for name, array in world_arrays(environment).items():
                values = self.arrays[name]
                if values.shape[0] != environment.num_worlds:
                    raise Kine2GoError(
                        f"a snapshot of {self.num_worlds} worlds does not fit {environment.num_worlds} worlds"
                    )
                if values.shape != array.numpy().shape:
                    raise Kine2GoError(f"{name} of the snapshot has shape {values.shape}, expected {array.shape}")
                array.assign(values)
            bodies = environment.randomization.bodies
            if environment.config.draws_bodies:
                bodies.apply_bodies()
            bodies.apply_friction()
            environment.episodes.done.zero_()

    def save(self, path: Path) -> None:
        """Write a NumPy archive, whole or not at all."""
        with atomic_file(path) as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, **self.arrays)  # pyright: ignore[reportArgumentType]

    @classmethod
    def load(cls, path: Path) -> "WorldSnapshot":
        """Read a snapshot.

        Raises:
            Kine2GoError: it cannot be read.
        """
        try:
            with np.load(path, allow_pickle=False) as archive:
                return cls({name: archive[name] for name in archive.files})
        except (OSError, ValueError, KeyError) as error:
            raise Kine2GoError(f"{path}: not a snapshot that can be read ({error})") from None


def training_arrays(environment: ImitationEnvironment) -> dict[str, wp.array[Any]]:
    """Return what else training needs to go on, by name; the first axis of each is the world.

    It is what policy and critic see, with its history, and each world's steps where limits of failure are annealed.
    """
    arrays = {"observation": environment.observation, "privileged_observation": environment.privileged_observation}
    return arrays | ({"world_steps": environment.episodes.world_steps} if environment.config.anneals_limits else {})


def phase_arrays(environment: ImitationEnvironment) -> dict[str, wp.array[Any]]:
    """Return what is learned of where robots fail, by name, shape [bins] each; nothing if it is not used."""
    episodes = environment.episodes
    if not episodes.config.phase_sampling.is_weighted:
        return {}
    table = episodes.phase_table
    return {"visits": table.visits, "failures": table.failures, "cumulative": table.cumulative}


@dataclass(frozen=True)
class EnvironmentSnapshot:
    """All that an environment needs to go on exactly under a policy, between two control steps."""

    worlds: dict[str, NDArray[Any]]
    """As in ``world_arrays`` and ``training_arrays``; the first axis of each is the world."""
    phases: dict[str, NDArray[Any]]
    """As in ``phase_arrays``, one table for each process that has its own, shape [num_tables, bins] each."""

    @classmethod
    def take(cls, environment: ImitationEnvironment) -> "EnvironmentSnapshot":
        """Copy the state of an environment to the host."""
        worlds = {**world_arrays(environment), **training_arrays(environment)}
        return cls(
            {name: array.numpy().copy() for name, array in worlds.items()},
            {name: array.numpy()[None].copy() for name, array in phase_arrays(environment).items()},
        )

    @classmethod
    def joined(cls, parts: Sequence["EnvironmentSnapshot"]) -> "EnvironmentSnapshot":
        """Return the snapshot of environments that share the worlds of a larger one."""
        worlds = {name: np.concatenate([part.worlds[name] for part in parts]) for name in parts[0].worlds}
        phases = {name: np.concatenate([part.phases[name] for part in parts]) for name in parts[0].phases}
        return cls(worlds, phases)

    def split(self, counts: Sequence[int]) -> list["EnvironmentSnapshot"]:
        """Return the snapshots of environments of so many worlds each.

        Raises:
            Kine2GoError: there are tables of phases, but not one for each.
        """
        if any(len(tables) != len(counts) for tables in self.phases.values()):
            raise Kine2GoError(f"phases learned by another number of processes do not fit {len(counts)} of them")
        parts, first = [], 0
        for index, count in enumerate(counts):
            worlds = {name: array[first : first + count] for name, array in self.worlds.items()}
            phases = {name: tables[index : index + 1] for name, tables in self.phases.items()}
            parts.append(EnvironmentSnapshot(worlds, phases))
            first += count
        return parts

    def restore(self, environment: ImitationEnvironment) -> None:
        """Put the state back into an environment of the same settings.

        Raises:
            Kine2GoError: it does not fit.
        """
        WorldSnapshot(self.worlds).restore(environment)
        with wp.ScopedDevice(environment.device):
            for name, array in training_arrays(environment).items():
                array.assign(self.worlds[name])
            for name, array in phase_arrays(environment).items():
                array.assign(self.phases[name][0])
