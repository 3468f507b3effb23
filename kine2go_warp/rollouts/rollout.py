"""The one rollout loop: a policy acts in all worlds of an environment, and every control step becomes a row."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import torch
import warp as wp
from numpy.typing import NDArray
from tensordict import TensorDict

from kine2go_warp.dataset.trajectories import padded
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.learning.vec_env import ImitationVecEnv
from kine2go_warp.rollouts.recorder import RolloutRecorder
from kine2go_warp.rollouts.row_writer import RowStore
from kine2go_warp.rotations import continuous

STEPS_BETWEEN_LOOKS = 64
"""Control steps between two reports of progress; it is then also checked whether every rollout has failed."""

Rows = dict[str, NDArray[Any]]


class Actor(Protocol):
    """What acts in the worlds, such as ``NoisyPolicy``."""

    def __call__(self, observation: TensorDict, noise: torch.Tensor | float) -> tuple[torch.Tensor, torch.Tensor]:
        """Return mean and sampled action, each of shape [num_worlds, 12]."""
        ...


@dataclass(frozen=True)
class InitialStates:
    """Where rollouts begin, before the warm-up; the first axis of each array is the rollout."""

    phase: NDArray[Any]
    """Phase of the reference, in [0, 1), or less than 0 before the beginning of a motion that is played once."""
    heading: NDArray[Any]
    """Rotation of the reference about the world's z axis [rad]."""
    joint_q: NDArray[Any]
    """Newton's coordinates, shape [num_rollouts, 19]."""
    joint_qd: NDArray[Any]
    """Newton's velocities, shape [num_rollouts, 18]."""

    @classmethod
    def of(cls, environment: ImitationEnvironment) -> "InitialStates":
        """Copy the present state of all worlds. It waits for the device."""
        placement, robot = environment.episodes.placement, environment.robot
        arrays = (placement.start_phase, placement.heading, robot.joint_q, robot.joint_qd)
        return cls(*(array.numpy().copy() for array in arrays))


@dataclass(frozen=True)
class RecordedRollouts:
    """Rollouts of equal nominal length, each recorded up to its end."""

    names: tuple[str, ...]
    """Names of the arrays that every row has."""
    read: Callable[[str, NDArray[Any]], NDArray[Any]]
    """Return one array of some rollouts, NaN beyond the end of each, shape [num_chosen, num_rows, ...]."""
    length: NDArray[Any]
    """Rows of each rollout, shape [num_rollouts]."""
    failure: NDArray[Any]
    """Why each rollout ended early, no text if it did not, shape [num_rollouts]."""
    initial: InitialStates
    final: dict[str, NDArray[Any]] = field(default_factory=dict)
    """State after the last row by the names of ``FINAL_STATE_ARRAYS``, NaN for rollouts that ended early."""
    rows_simulated: int = 0
    """Rows recorded of all rollouts, those after an early end included."""

    def rows(self, chosen: NDArray[Any]) -> Rows:
        """Return all arrays of some rollouts."""
        return {name: self.read(name, chosen) for name in self.names}


def roll_out(
    env: ImitationVecEnv,
    actor: Actor,
    noise: torch.Tensor | float,
    num_rows: int,
    writer: RowStore,
    warm_up: int = 0,
    on_first_row: Callable[[], None] | None = None,
    on_progress: Callable[[int], None] | None = None,
    record_observation: bool = False,
) -> RecordedRollouts:
    """Let a policy act in every world from its present state on.

    Row t holds the state before control step t and the action chosen from it. A rollout ends with the first
    termination of its world. The row whose control step failed counts: its state is the last one before the failure.
    The state that failed is never a row, since the world begins a new episode within the same step.

    Args:
        env: The worlds. Their episodes must be longer than the rollouts, so that only failures end them.
        actor: The policy.
        noise: Noise on the actions in standard deviations of the policy, shape [num_worlds, 1] or one for all.
        num_rows: Rows of a rollout that does not fail.
        writer: Where rows go; it is closed at the end, and the rollouts are read from it.
        warm_up: Control steps before the first row. A rollout that fails within them has no rows.
        on_first_row: Called after the warm-up, before the first row is recorded; it may put worlds into other states.
        on_progress: Called now and then with the control steps done, the warm-up included.
        record_observation: Whether rows also hold what the actor saw.

    Raises:
        OSError: rows could not be written.
        SimulationError: the environment stops at faults, and there was one.
    """
    environment = env.environment
    initial, recorder = InitialStates.of(environment), RolloutRecorder(environment, writer)
    reason = wp.to_torch(environment.episodes.reason)
    failure, survived = torch.zeros_like(reason), torch.zeros_like(reason)
    observation, steps = env.get_observations(), 0
    for step in range(warm_up + num_rows):
        if step == warm_up and on_first_row is not None:
            on_first_row()
            observation = env.get_observations()
        mean, action = actor(observation, noise)
        if step >= warm_up:
            recorder.record_state(mean, observation["policy"] if record_observation else None)
        observation, *_ = env.step(action)
        if step >= warm_up:
            recorder.record_action()
        failure = torch.where(failure == 0, reason, failure)
        survived += (failure == 0).int()
        steps = step + 1
        if steps % STEPS_BETWEEN_LOOKS == 0:
            if on_progress is not None:
                on_progress(steps)
            if step > warm_up and bool((failure > 0).all()):
                break
    recorder.finish()
    writer.close()
    final = recorder.present_state()
    counted = survived + (failure > 0).int() - warm_up
    length = counted.clamp(min=0, max=num_rows).cpu().numpy().astype(np.int32)

    def read(name: str, chosen: NDArray[Any]) -> NDArray[Any]:
        recorded = writer.read(name, chosen)
        rows = np.full((len(chosen), num_rows, *recorded.shape[2:]), np.nan, np.float32)
        rows[:, : recorded.shape[1]] = recorded
        return padded(continuous(rows, axis=1) if name.endswith("orientation") else rows, length[chosen])

    last = read("root_orientation", np.arange(env.num_envs))[:, -1]
    orientation = final["root_orientation"]
    final["root_orientation"] = np.where(np.sum(last * orientation, -1, keepdims=True) < 0.0, -orientation, orientation)
    for values in final.values():
        values[failure.cpu().numpy() > 0] = np.nan
    rows_simulated = env.num_envs * max(steps - warm_up, 0)
    reasons = np.array(environment.config.reason_names)[failure.cpu().numpy()]
    return RecordedRollouts(writer.names, read, length, reasons, initial, final, rows_simulated)
