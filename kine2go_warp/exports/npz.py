"""One .npz file a trajectory, for anyone with NumPy."""

import json
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import numpy as np

from kine2go_warp.dataset.access import Dataset
from kine2go_warp.dataset.motion import Motion, Trajectory
from kine2go_warp.exports.features import Field, stored
from kine2go_warp.exports.target import Output, Target

LOADING = """\
import json
import numpy as np

with np.load("{motion}/trajectory-0000.npz", allow_pickle=False) as file:
    attributes = json.loads(str(file["attributes"]))
    states, actions = file["joint_position"], file["action"]  # rows x joints
"""


def npz_fields(motion: Motion) -> list[Field]:
    """Return the row arrays, all as they are."""
    return [stored(motion, name) for name in motion.row_arrays]


def write_motion(output: Output, name: str, trajectories: Iterator[Trajectory]) -> None:
    """Write every trajectory as ``MOTION/trajectory-NNNN.npz``, NNNN being its index in the dataset.

    A file holds each row array, cut to the trajectory's length, each array of trajectories (``noise``,
    ``quality/joint_rmse``), ``time``, and ``attributes``: a text with all attributes as JSON.

    Raises:
        DatasetError: an array cannot be read.
    """
    motion = output.dataset.motion(name)
    text = np.array(json.dumps(attributes(output.dataset, motion)))
    for one in trajectories:
        path = output.folder / name / f"trajectory-{one.index:04d}.npz"
        path.parent.mkdir(exist_ok=True)
        content = {name: np.asarray(value) for name, value in one.values.items()}
        content |= {name: np.ascontiguousarray(values) for name, values in one.arrays.items()}
        content |= {"time": motion.time[: one.length], "attributes": text}
        with path.open("wb") as file:
            np.savez(file, allow_pickle=False, **content)


def attributes(dataset: Dataset, motion: Motion) -> dict[str, Any]:
    """Return all that the store says besides numbers: of the dataset, of the motion, and of each array."""
    labelled = [name for name, spec in motion.arrays.items() if spec.dims == (name,)]
    return {
        "dataset": dataset.attributes,
        "motion": motion.attributes,
        "arrays": {name: asdict(spec) for name, spec in motion.arrays.items()},
        "labels": {name: list(motion.labels(name)) for name in labelled if name != "trajectory"},
    }


NPZ = Target(
    title="one .npz file a trajectory",
    write=write_motion,
    fields=npz_fields,
    loading=LOADING,
    about="Arrays of each file.",
)
