"""Samples a training for an observer: some worlds for a stretch now and then, and the curves of all iterations."""

import time
from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np
import torch
import warp as wp
from numpy.typing import NDArray

from kine2go_warp.env.clips import make_reference_state
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.kernels import launch
from kine2go_warp.kernels.reference import sample_reference
from kine2go_warp.learning.vec_env import BufferedVecEnv
from kine2go_warp.training.logger import TrainingProgress
from kine2go_warp.training.runner import ProgressCallback

NUM_WORLDS = 4
"""Worlds that are shown."""
STRETCH = 120
"""Control steps that are shown in one go."""
INTERVAL = 10.0
"""Least time from the beginning of one stretch to that of the next [s]."""
BLOCK = 6
"""Control steps that are taken off the device together."""

PARTS = {
    "root_position": (3,),
    "root_orientation": (4,),
    "joint_position": (12,),
    "reference_root_position": (3,),
    "reference_root_orientation": (4,),
    "reference_joint_position": (12,),
    "foot_contact_force": (4, 3),
}
"""What is shown of a world, in the order in which it is packed; quaternions are packed as (x, y, z, w)."""

Rows = Mapping[str, NDArray[np.float32]]


class TrainingObserver(Protocol):
    """Receives samples of a training. Its methods are called between control steps, so they must return at once."""

    def on_worlds(self, time: NDArray[np.float64], rows: Rows) -> None:
        """Receive some worlds over some control steps.

        Args:
            time: Simulated time of each world since the training began [s], shape [num_steps].
            rows: Arrays named and laid out as in the dataset, shape [num_worlds, num_steps, ...].
        """
        ...

    def on_iteration(self, time: float, iteration: int, curves: Mapping[str, float]) -> None:
        """Receive the metrics of one iteration, by ``group/name``."""
        ...


def attach_observer(
    env: BufferedVecEnv, observer: TrainingObserver, on_progress: ProgressCallback | None, first_step: int
) -> ProgressCallback:
    """Send samples of an environment to an observer, and return what to call after each iteration.

    Args:
        env: The environment that trains.
        observer: Receives worlds and curves.
        on_progress: What else to call after each iteration.
        first_step: Control steps that were trained before.
    """
    sampler = WorldSampler(env, observer, first_step)
    env.on_step = sampler.step_done

    def iteration_done(progress: TrainingProgress) -> None:
        sampler.iteration_done(progress)
        if on_progress is not None:
            on_progress(progress)

    return iteration_done


class WorldSampler:
    """Takes what is to be seen off the device. It changes nothing of the training."""

    def __init__(
        self,
        env: BufferedVecEnv,
        observer: TrainingObserver,
        first_step: int,
        clock: Callable[[], float] = time.monotonic,
        interval: float = INTERVAL,
    ) -> None:
        """Prepare.

        Args:
            env: The environment that trains.
            observer: Receives worlds and curves.
            first_step: Control steps that were trained before.
            clock: Tells the time that passes [s].
            interval: Least time from the beginning of one stretch to that of the next [s].
        """
        self.environment, self.observer, self.clock, self.step = env.environment, observer, clock, first_step
        self.interval = interval
        self.num_worlds = min(NUM_WORLDS, self.environment.num_worlds)
        self._reference = make_reference_state(self.num_worlds, self.environment.device)
        self._views = self._packed_views()
        self._all_terms = env.buffers.reward_terms
        self._terms, self._num_terms = torch.zeros(self._all_terms.shape[1], device=env.device), 0
        self._block: list[torch.Tensor] = []
        self._left, self._next_stretch = 0, -float("inf")

    def step_done(self) -> None:
        """Look at the worlds after a control step, if it is time to."""
        self.step += 1
        self._terms += self._all_terms.mean(dim=0)
        self._num_terms += 1
        now = self.clock()
        if self._left == 0 and now >= self._next_stretch:
            self._left, self._next_stretch = STRETCH, now + self.interval
        if self._left > 0:
            self._left -= 1
            self._take()
            if len(self._block) == BLOCK or self._left == 0:
                self._hand_over()

    def iteration_done(self, progress: TrainingProgress) -> None:
        """Hand over the metrics of an iteration."""
        terms = (self._terms / max(self._num_terms, 1)).tolist()
        self._terms.zero_()
        self._num_terms = 0
        curves = {
            **{
                f"reward/{name}": value for name, value in zip(self.environment.config.reward_names, terms, strict=True)
            },
            **{f"error/{name}": value for name, value in tracking_errors(self.environment).items()},
            "return/mean": progress.reward,
            "length/mean": progress.episode_length,
            "speed/steps_per_second": progress.steps_per_second,
        }
        if progress.evaluation is not None and progress.evaluation.iteration == progress.iteration:
            curves |= progress.evaluation.curves
        self.observer.on_iteration(self.step / self.environment.config.control_rate, progress.iteration, curves)

    def _packed_views(self) -> tuple[torch.Tensor, ...]:
        """Return tensors over the environment's arrays, of the worlds that are shown, in the order of ``PARTS``."""
        environment, count = self.environment, self.num_worlds
        arrays = (
            environment.robot.joint_q,
            self._reference.root,
            self._reference.joint_position,
            environment.simulation.foot_force,
        )
        return tuple(wp.to_torch(array)[:count].reshape(count, -1) for array in arrays)

    def _take(self) -> None:
        """Keep the present state; the reference is sampled anew, as an episode that has just begun has another one."""
        episodes = self.environment.episodes
        with wp.ScopedDevice(self.environment.device):
            place = [episodes.clips, episodes.placement, episodes.reference_step]
            launch(sample_reference, dim=self.num_worlds, inputs=[*place, self._reference])
        self._block.append(torch.cat(self._views, dim=1))

    def _hand_over(self) -> None:
        """Send what was kept to the observer."""
        packed = torch.stack(self._block, dim=1).cpu().numpy()
        last = self.step + 1
        steps = np.arange(last - len(self._block), last)
        self._block = []
        self.observer.on_worlds(steps / self.environment.config.control_rate, unpacked(packed))


def unpacked(packed: NDArray[np.float32]) -> dict[str, NDArray[np.float32]]:
    """Take packed rows, shape [..., 50], apart; quaternions become (w, x, y, z)."""
    rows, first = {}, 0
    for name, shape in PARTS.items():
        size = int(np.prod(shape))
        values = packed[..., first : first + size].reshape(*packed.shape[:-1], *shape)
        rows[name] = values[..., [3, 0, 1, 2]] if name.endswith("orientation") else values
        first += size
    return rows


def tracking_errors(environment: ImitationEnvironment) -> dict[str, float]:
    """Return mean errors [m, rad, rad] of the worlds of this process whose episode goes on, NaN if there are none."""
    goes_on = wp.to_torch(environment.episodes.done) == 0
    state = wp.to_torch(environment.robot.joint_q)[goes_on]
    root = wp.to_torch(environment.reference.root)[goes_on]
    joints = state[:, 7:] - wp.to_torch(environment.reference.joint_position)[goes_on]
    apart = (state[:, 3:7] - root[:, 3:]).norm(dim=-1)
    together = (state[:, 3:7] + root[:, 3:]).norm(dim=-1)
    angle = 4.0 * torch.atan2(torch.minimum(apart, together), torch.maximum(apart, together))
    errors = {
        "root_distance": (state[:, :3] - root[:, :3]).norm(dim=-1),
        "root_angle": angle,
        "joint_rmse": joints.square().mean(dim=-1).sqrt(),
    }
    return {name: float(values.mean()) for name, values in errors.items()}
