"""Everything that a world needs to go on exactly as it did: taken, saved, and put back."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import warp as wp
from numpy.typing import NDArray

from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.files import atomic_file


def world_arrays(environment: ImitationEnvironment) -> dict[str, wp.array]:
    """Return the arrays that decide a world's future, by name; the first axis of each is the world."""
    simulation, motors = environment.simulation, environment.motors
    episodes, randomization = environment.episodes, environment.randomization
    return {
        "joint_q": environment.robot.joint_q,
        "joint_qd": environment.robot.joint_qd,
        "warm_start": simulation.warm_start,
        "target_queue": motors.target_queue,
        "last_output": environment.output,
        "stiffness": motors.model.stiffness,
        "damping": motors.model.damping,
        "strength": motors.model.strength,
        "motor_offset": motors.model.offset,
        "delay": motors.model.delay,
        "base_mass": randomization.bodies.base.mass,
        "base_com": randomization.bodies.base.com,
        "friction": randomization.bodies.friction,
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

    arrays: dict[str, NDArray]
    """As in ``world_arrays``; the first axis of each is the world."""

    @classmethod
    def take(cls, environment: ImitationEnvironment) -> "WorldSnapshot":
        """Copy the state of all worlds to the host."""
        return cls({name: array.numpy().copy() for name, array in world_arrays(environment).items()})

    @property
    def num_worlds(self) -> int:
        """Number of worlds."""
        return len(self.arrays["joint_q"])

    def selected(self, which: NDArray) -> "WorldSnapshot":
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
            if environment.config.randomization.base_mass or environment.config.randomization.base_com:
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
