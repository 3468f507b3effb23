"""One .npz file a trajectory, for anyone with NumPy."""

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from kine2go_warp.dataset.access import Dataset
from kine2go_warp.dataset.motion import Motion
from kine2go_warp.exports.fields import Field, array_field

LOADING = """\
import json
import numpy as np

with np.load("{motion}/trajectory-0000.npz", allow_pickle=False) as file:
    attributes = json.loads(str(file["attributes"]))
    states, actions = file["joint_position"], file["action"]  # rows x joints
"""


def write_npz(dataset: Dataset, folder: Path, on_trajectory: Callable[[int, int], None] | None = None) -> list[Field]:
    """Write every trajectory as ``MOTION/trajectory-NNNN.npz``, NNNN being its index in the dataset.

    A file holds each row array, cut to the trajectory's length, each array of trajectories (``noise``,
    ``quality/joint_rmse``), ``time``, and ``attributes``: a text with all attributes as JSON.

    Args:
        dataset: What to write.
        folder: Where; it exists and is empty.
        on_trajectory: Called with the trajectories written and their total.

    Returns:
        The fields with one entry a row.

    Raises:
        DatasetError: an array cannot be read.
    """
    for done, one in enumerate(dataset.trajectories(), start=1):
        motion = dataset.motion(one.motion)
        path = folder / one.motion / f"trajectory-{one.index:04d}.npz"
        path.parent.mkdir(exist_ok=True)
        content = {name: np.asarray(value) for name, value in one.values.items()}
        content |= {name: np.ascontiguousarray(values) for name, values in one.arrays.items()}
        content["time"] = motion.time[: one.length]
        content["attributes"] = np.array(json.dumps(attributes(dataset, motion)))
        with path.open("wb") as file:
            np.savez(file, allow_pickle=False, **content)
        if on_trajectory is not None:
            on_trajectory(done, len(dataset.references))
    first = dataset.motion(dataset.references[0].motion)
    return [array_field(first, name) for name in first.row_arrays]


def attributes(dataset: Dataset, motion: Motion) -> dict[str, Any]:
    """Return all that the store says besides numbers: of the dataset, of the motion, and of each array."""
    labelled = [name for name, spec in motion.arrays.items() if spec.dims == (name,)]
    return {
        "dataset": dataset.attributes,
        "motion": motion.attributes,
        "arrays": {name: asdict(spec) for name, spec in motion.arrays.items()},
        "labels": {name: list(motion.labels(name)) for name in labelled if name != "trajectory"},
    }
