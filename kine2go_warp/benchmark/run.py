"""Rolling a policy out from the initial states of a dataset, and scoring it against the dataset's own rollouts."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.benchmark.config import BenchmarkConfig
from kine2go_warp.benchmark.observation import Observation, Rows
from kine2go_warp.benchmark.policies import Act, BenchmarkPolicy
from kine2go_warp.benchmark.splits import split_of
from kine2go_warp.dataset.access import Dataset
from kine2go_warp.dataset.motion import MotionData
from kine2go_warp.errors import PolicyError
from kine2go_warp.robots import RobotSpec
from kine2go_warp.rollouts.worlds import STATES, Scene, Worlds
from kine2go_warp.rotations import rotation_angle
from kine2go_warp.scores.registry import METRICS, Rollouts
from kine2go_warp.scores.statistics import Estimate, estimate_mean, estimate_share

METRIC_NAMES = ("joint_mse", "joint_emd", "body_emd", "root_error", "foot_slip", "power")
"""Metrics of a rollout, of which less is better; the score compares each with that of the dataset."""
SURVIVAL, SCORE = "survival", "score"
CONDITIONS = ("recorded", "perturbed")
"""From the recorded initial states, and with a kick to the base there."""

REFERENCES = (
    "reference_root_position", "reference_root_orientation", "reference_joint_position",
    "reference_root_linear_velocity", "reference_root_angular_velocity", "reference_joint_velocity",
)  # fmt: skip
LOADS = ("joint_power_mean", "foot_contact_force", "link_position", "link_linear_velocity")

Progress = Callable[[int, int, str], None]


@dataclass(frozen=True)
class MotionResult:
    """A policy on one motion under one condition."""

    motion: str
    split: str
    """``train`` or ``held_out``."""
    condition: str
    estimates: dict[str, Estimate]
    """Metrics, survival and score of the policy."""
    data: dict[str, float]
    """Means of the same metrics over the recorded rollouts."""


def benchmark_motion(
    dataset: Dataset,
    name: str,
    policy: BenchmarkPolicy,
    config: BenchmarkConfig,
    device: str,
    on_progress: Progress | None = None,
) -> list[MotionResult]:
    """Benchmark a policy on one motion, under each of ``CONDITIONS``.

    Args:
        dataset: Where rollouts begin, and what they are compared with.
        name: The motion.
        policy: The policy.
        config: Settings.
        device: Where Newton simulates.
        on_progress: Called now and then with rows done, rows in all, and details.

    Raises:
        DatasetError: the dataset cannot be read, or does not tell how it was simulated.
        PolicyError: the policy cannot act on this robot, or returns something else than finite actions.
    """
    data, spec = first_trajectories(dataset, name, config.trajectories), dataset.robot
    scene, recorded = Scene.of(dataset.path, data, spec), recorded_rows(data)
    own = measured(recorded, data.trajectories.draws["length"], data, spec)
    reference, num_rows, found = references(data), data.trajectories.num_rows, []
    for index, condition in enumerate(CONDITIONS):
        here = kicked(scene, config) if condition == "perturbed" else scene

        def rolled(row: int, before: int = index * num_rows, detail: str = f"{name}, {condition}") -> None:
            if on_progress is not None:
                on_progress(before + row, len(CONDITIONS) * num_rows, detail)

        worlds = here.open(config.engine, device, record_loads=True)
        rows, length = roll_out(worlds, policy.begin(spec, reference), data, reference, scene, config, rolled)
        values, survived = measured(rows, length, data, spec), length >= data.trajectories.draws["length"]
        found.append(MotionResult(name, split_of(name), condition, *compared(values, own, survived)))
    return found


def first_trajectories(dataset: Dataset, name: str, count: int) -> MotionData:
    """Load the first trajectories of a motion that reviews left in it."""
    chosen = set(dataset.select([name]).references[:count])
    return dataset.select([name], where=lambda one: one in chosen).load(name)


def references(data: MotionData) -> Rows:
    """Return the references, each array of shape [num_trajectories, num_rows, ...]; after its last row each stays."""
    rows, length = data.trajectories.rows, data.trajectories.draws["length"]
    place = np.minimum(np.arange(data.trajectories.num_rows), length[:, None] - 1)
    return {name: rows[name][np.arange(len(length))[:, None], place].astype(np.float64) for name in REFERENCES}


def kicked(scene: Scene, config: BenchmarkConfig) -> Scene:
    """Return the scene with a kick to every base."""
    joint_qd = scene.initial["joint_qd"].copy()
    angle = np.random.default_rng(config.seed).uniform(-np.pi, np.pi, len(joint_qd))
    joint_qd[:, :2] += config.kick * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return replace(scene, initial={**scene.initial, "joint_qd": joint_qd})


def roll_out(
    worlds: Worlds,
    act: Act,
    data: MotionData,
    reference: Rows,
    scene: Scene,
    config: BenchmarkConfig,
    on_row: Callable[[int], None],
) -> tuple[Rows, NDArray[np.int_]]:
    """Let a policy act in all worlds along the recorded references.

    Args:
        worlds: Where they begin.
        act: The policy.
        data: The record, for its pushes.
        reference: What is tracked; see ``references``.
        scene: Of the worlds.
        config: Settings.
        on_row: Called with the number of rows done.

    Returns:
        Rows by name, each of shape [num_worlds, num_rows, ...], NaN beyond the end of each, and the length of each.

    Raises:
        PolicyError: it returns something else than finite actions.
    """
    recorded, spec, length = data.trajectories.rows, scene.spec, data.trajectories.draws["length"]
    seen = Observation(reference, first_action(scene))
    rows: dict[str, list[NDArray[Any]]] = {}
    alive, lasted = np.ones(len(length), bool), np.zeros(len(length), int)
    for row in range(data.trajectories.num_rows):
        state = worlds.state()
        alive &= ~lost(state, {name: values[:, row] for name, values in reference.items()}, config) & (row < length)
        lasted += alive
        if not alive.any():
            break
        for name, values in (state | (worlds.loads() if row else {})).items():
            kept = rows.setdefault(name, [np.full_like(values, np.nan, np.float64)] * row)
            kept.append(np.where(alive.reshape(-1, *[1] * (values.ndim - 1)), values, np.nan))
        seen.add_state(state)
        action = checked(act(seen), alive)
        seen.add_action(action)
        push = np.nan_to_num(recorded["push"][:, row])
        worlds.step((spec.default_joint_position + spec.action_scale * action).astype(np.float32), push)
        on_row(row + 1)
    stacked = {name: np.stack(values, axis=1) for name, values in rows.items()}
    ends = np.arange(next(iter(stacked.values())).shape[1]) < lasted[:, None]
    for name, values in reference.items():
        part = values[:, : ends.shape[1]]
        stacked[name] = np.where(ends.reshape(*ends.shape, *[1] * (part.ndim - 2)), part, np.nan)
    return stacked, lasted


def first_action(scene: Scene) -> NDArray[Any]:
    """Return the action before the first row, shape [num_worlds, 12]: the newest target on its way to the motors."""
    queue, step = scene.initial["target_queue"], scene.initial["reference_step"]
    target = queue[np.arange(len(queue)), (step - 1) % queue.shape[1]]
    return (target - scene.spec.default_joint_position) / scene.spec.action_scale


def checked(action: Any, alive: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return what a policy returned, zero for robots whose rollouts have ended.

    Raises:
        PolicyError: it is something else than finite actions.
    """
    values = np.asarray(action)
    if values.shape != (len(alive), 12) or not np.issubdtype(values.dtype, np.number):
        raise PolicyError(f"the policy returned {values.dtype} of shape {values.shape}, not actions ({len(alive)}, 12)")
    if not np.isfinite(values[alive]).all():
        raise PolicyError("the policy returned actions that are not finite")
    return np.where(alive[:, None], values, 0.0)


def lost(state: Rows, reference: Rows, config: BenchmarkConfig) -> NDArray[np.bool_]:
    """Return which robots are too far from their references, shape [num_worlds]."""
    distance = np.linalg.norm(state["root_position"] - reference["reference_root_position"], axis=-1)
    angle = rotation_angle(state["root_orientation"], reference["reference_root_orientation"])
    return ~((distance <= config.max_distance) & (angle <= config.max_angle))


def recorded_rows(data: MotionData) -> Rows:
    """Return the dataset's own rows as ``roll_out`` has them: no loads in the first row."""
    rows = {name: data.trajectories.rows[name].astype(np.float64) for name in (*STATES, *REFERENCES, *LOADS)}
    for name in LOADS:
        rows[name][:, 0] = np.nan
    return rows


def measured(rows: Rows, length: NDArray[Any], data: MotionData, spec: RobotSpec) -> dict[str, NDArray[Any]]:
    """Return the metrics of rollouts, each of shape [num_trajectories]; those whose rows are missing are left out."""
    rollouts = Rollouts(rows, length, data.frame_duration, len(length), 0, spec)
    metrics = {metric.name: metric for metric in METRICS}
    there = [name for name in METRIC_NAMES if name != "foot_slip" or "foot_contact_force" in rows]
    return {name: metrics[name].compute(rollouts) for name in there}


def compared(
    values: dict[str, NDArray[Any]], own: dict[str, NDArray[Any]], survived: NDArray[np.bool_]
) -> tuple[dict[str, Estimate], dict[str, float]]:
    """Return the estimates of a policy with its score, and the means of the recorded rollouts.

    The score is survival times the mean over the metrics of how the dataset's mean compares with the policy's, at
    most 1 each. So rollouts that are as good as the dataset's have 1.
    """
    estimates = {name: estimate_mean([one]) for name, one in values.items()}
    data = {name: float(np.nanmean(own[name])) for name in values}
    share = estimate_share([survived])
    ratios = [min(1.0, data[name] / max(estimates[name].value, 1e-12)) for name in values]
    score = share.value * float(np.nanmean(ratios))
    return {**estimates, SURVIVAL: share, SCORE: Estimate(score, np.nan, np.nan, len(survived))}, data
