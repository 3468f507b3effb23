"""Scores of a dataset, motion by motion and overall, and the JSON file that holds them."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from kine2go_warp.dataset.access import Dataset
from kine2go_warp.dataset.motion import MotionData
from kine2go_warp.errors import DatasetError
from kine2go_warp.files import atomic_file
from kine2go_warp.robots import RobotSpec
from kine2go_warp.robots.compiled import model_difference
from kine2go_warp.scores import statistics, transport
from kine2go_warp.scores.registry import METRICS, Rollouts
from kine2go_warp.scores.statistics import Estimate, estimate_mean, estimate_share
from kine2go_warp.tables import counted


@dataclass(frozen=True)
class MotionMetrics:
    """The metrics of one motion, one a trajectory."""

    motion: str
    trajectories: int
    rows: int
    """Rows of all trajectories together."""
    metrics: Mapping[str, NDArray[Any]]
    """By the names in ``METRICS``, each of shape [num_trajectories]; shares [num_rollouts]."""


@dataclass(frozen=True)
class DatasetScores:
    """Means with intervals, each by the names in ``METRICS``."""

    motions: Mapping[str, Mapping[str, Estimate]]
    """By motion."""
    overall: Mapping[str, Estimate]


def scored_motions(dataset: Dataset, motions: Sequence[str] = ()) -> list[str]:
    """Return the motions of a dataset that are named, or all of them, without those that have no trajectory left.

    Raises:
        DatasetError: the dataset is empty, it lacks one of the motions, or a review rejected all of their trajectories.
    """
    names = dataset.chosen(motions)
    kept = [name for name in names if len(dataset.left_out(name)) < max(1, len(dataset.motion(name).lengths))]
    if not kept:
        raise DatasetError(f"{dataset.path}: all trajectories were rejected in a review; nothing is left to score")
    return kept


def review_note(dataset: Dataset, motions: Sequence[str] = ()) -> str:
    """Return how many trajectories of some motions, by default all, reviews rejected; empty if there are none."""
    names = motions or dataset.motions
    left_out = sum(len(dataset.left_out(name)) for name in names)
    total = sum(len(dataset.motion(name).lengths) for name in names)
    return f"left out {left_out} of {counted(total, 'trajectory')}, rejected in a review" if left_out else ""


def robot_note(dataset: Dataset, spec: RobotSpec) -> str:
    """Return a remark if a dataset was made with another model of the robot, whose limits and mass are unknown here."""
    if dataset.attributes.get("robot_model_sha256") == spec.model_hash:
        return ""
    found = sorted({model_difference(dataset.motion(name).attributes, spec) for name in dataset.motions} - {""})
    changes = f" ({'; '.join(found)})" if found else ""
    return f"made with another robot model{changes}: feet, limits and mass are taken from the present one"


def measure(data: MotionData, spec: RobotSpec) -> MotionMetrics:
    """Compute all metrics of a motion."""
    rollouts = Rollouts.of(data, spec)
    return MotionMetrics(
        motion=data.name,
        trajectories=len(rollouts.length),
        rows=int(rollouts.length.sum()),
        metrics={metric.name: metric.compute(rollouts) for metric in METRICS},
    )


def score(measured: Sequence[MotionMetrics]) -> DatasetScores:
    """Turn metrics into means with intervals."""
    return DatasetScores({one.motion: _estimates([one]) for one in measured}, _estimates(measured))


def _estimates(measured: Sequence[MotionMetrics]) -> dict[str, Estimate]:
    """Return all estimates over some motions."""
    return {
        metric.name: (estimate_share if metric.is_share else estimate_mean)(
            [one.metrics[metric.name] for one in measured]
        )
        for metric in METRICS
    }


def write_json(dataset: Path, measured: Sequence[MotionMetrics], scores: DatasetScores, path: Path) -> None:
    """Write scores, what they mean and how they were computed; null stands for what cannot be measured."""
    content = {
        "dataset": str(dataset),
        "settings": {
            "confidence": statistics.CONFIDENCE,
            "resamples": statistics.RESAMPLES,
            "seed": statistics.SEED,
            "emd_most_samples": transport.MOST_SAMPLES,
        },
        "metrics": {
            metric.name: {"unit": metric.unit, "better": metric.better, "description": metric.description}
            for metric in METRICS
        },
        "overall": _plain(scores.overall),
        "motions": {
            one.motion: {
                "trajectories": one.trajectories,
                "rows": one.rows,
                "scores": _plain(scores.motions[one.motion]),
            }
            for one in measured
        },
    }
    with atomic_file(path) as temporary:
        temporary.write_text(json.dumps(content, indent=2, allow_nan=False) + "\n")


def _plain(estimates: Mapping[str, Estimate]) -> dict[str, Any]:
    """Return estimates as JSON has them."""
    return without_nan({name: asdict(estimate) for name, estimate in estimates.items()})


def without_nan(value: Any) -> Any:
    """Return nested values as JSON has them: null instead of NaN."""
    if isinstance(value, dict):
        return {name: without_nan(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [without_nan(one) for one in value]
    return None if isinstance(value, float) and math.isnan(value) else value
