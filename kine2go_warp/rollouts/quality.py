"""How good each rollout is, and which ones are good enough."""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp import metrics
from kine2go_warp.dataset.schema import QUALITY_ARRAYS
from kine2go_warp.metrics import FILTER_METRICS, Rows
from kine2go_warp.robots import RobotSpec
from kine2go_warp.robots.kinematics import contact_velocities
from kine2go_warp.rollouts.config import GatherConfig

BORDERLINE = 0.8
"""A rollout one of whose metrics exceeds this share of its limit is worth a look."""


@dataclass(frozen=True)
class FilterResult:
    """Which of some rollouts pass the filter."""

    reasons: tuple[str, ...]
    """Why each one is rejected, an empty text if it is not."""
    quality: dict[str, NDArray[Any]]
    """Arrays of ``QUALITY_ARRAYS``, each of shape [num_trajectories]."""

    @property
    def accepted(self) -> NDArray[np.bool_]:
        """Which rollouts are good enough."""
        return np.array([not reason for reason in self.reasons], dtype=bool)


def rollout_quality(rows: Rows, frame_duration: float, spec: RobotSpec) -> dict[str, NDArray[Any]]:
    """Return the metrics of rollouts but for the share of a limit, each of shape [num_trajectories].

    Args:
        rows: Rows as in the dataset, NaN beyond each trajectory's length.
        frame_duration: Time between two rows [s].
        spec: The robot.
    """
    return {
        **metrics.tracking_quality(rows),
        "largest_root_error": np.nanmax(metrics.root_error(rows), axis=1),
        "largest_root_angle": np.nanmax(metrics.root_angle(rows), axis=1),
        "leg_contact": np.nanmean(rows["leg_contact"], axis=1),
        "joint_limit": metrics.joint_limit_share(rows["joint_position"], spec.joint_lower, spec.joint_upper),
        "torque_saturation": metrics.torque_saturation(rows["torque_at_limit"]),
        "action_saturation": metrics.action_saturation(rows["joint_target"], spec.joint_lower, spec.joint_upper),
        "foot_slip": metrics.foot_slip(contact_velocities(spec, rows), rows["foot_contact_force"]),
        "joint_jerk": metrics.joint_jerk(rows["joint_velocity"], frame_duration),
        "joint_speed": np.nanmax(np.abs(rows["joint_velocity"]) / np.array(spec.joint_speed), axis=(1, 2)),
        "leg_overlap": np.maximum(-np.nanmin(rows["leg_distance"], axis=1), 0.0),
    }


def rows_to_judge(rows: Rows, config: GatherConfig, frame_duration: float, recovery: NDArray[np.bool_] | None) -> Rows:
    """Return the rows with NaN where a robot is still on its way back; all of them where nothing else is left."""
    time = config.diversity.resolved().recovery_time
    if not time:
        return rows
    count = len(rows["push"])
    settled = metrics.settled_rows(
        rows["push"], np.zeros(count, bool) if recovery is None else recovery, round(time / frame_duration)
    )
    settled |= ~(settled & np.isfinite(rows["push"][..., 0])).any(axis=1, keepdims=True)
    shape = settled.shape
    return {
        name: np.where(settled.reshape(*shape, *(1,) * (values.ndim - 2)), values, np.nan)
        for name, values in rows.items()
    }


def filter_rollouts(
    rows: Rows,
    failures: NDArray[Any],
    config: GatherConfig,
    frame_duration: float,
    spec: RobotSpec,
    recovery: NDArray[np.bool_] | None = None,
) -> FilterResult:
    """Decide which rollouts are good enough, and for which reason the others are rejected.

    The metrics are those of all rows. What is judged are the rows in which a robot should be back at its reference, but
    for legs in one another, which no row may have.

    Args:
        rows: Rows as in the dataset, NaN beyond each trajectory's length.
        failures: Why the simulation ended each rollout early, no text if it did not.
        config: The limits.
        frame_duration: Time between two rows [s].
        spec: The robot.
        recovery: Which rollouts begin off their reference, shape [num_trajectories]; by default none.
    """
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        # A rollout that failed at once has no rows: its metrics are NaN, and its reason is known.
        warnings.simplefilter("ignore")
        quality = rollout_quality(rows, frame_duration, spec)
        judged = rows_to_judge(rows, config, frame_duration, recovery)
        settled = quality if judged is rows else rollout_quality(judged, frame_duration, spec)
    settled["leg_overlap"] = quality["leg_overlap"]
    shares = {one.name: settled[one.name] / getattr(config, one.setting) for one in FILTER_METRICS}
    quality["worst_limit_ratio"] = np.max(np.stack(list(shares.values())), axis=0)
    reasons = []
    for index, failure in enumerate(failures):
        exceeded = [one.reason for one in FILTER_METRICS if not shares[one.name][index] <= 1.0]
        reasons.append(str(failure) or next(iter(exceeded), ""))
    assert set(quality) == {array.name for array in QUALITY_ARRAYS}
    return FilterResult(tuple(reasons), {name: np.asarray(values, np.float32) for name, values in quality.items()})
