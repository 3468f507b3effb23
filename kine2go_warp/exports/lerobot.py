"""The layout of a LeRobot dataset, version 3.0, without video."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from kine2go_warp.dataset.access import Dataset
from kine2go_warp.dataset.motion import Motion, Trajectory, TrajectoryReference
from kine2go_warp.errors import ExportError
from kine2go_warp.exports.fields import Field, array_field, joined_field
from kine2go_warp.exports.lerobot_statistics import EpisodeStatistics, episode_statistics, merged_statistics
from kine2go_warp.exports.rolling import FILE_MEGABYTES, FILES_A_CHUNK, PATH_TEMPLATE, RollingParquet

CODEBASE_VERSION = "v3.0"

STATE_ARRAYS = (
    "root_orientation",
    "root_linear_velocity",
    "root_angular_velocity",
    "joint_position",
    "joint_velocity",
)
"""What ``observation.state`` holds, in this order."""

POLICY_PREFIXES = ("action", "observation")
"""LeRobot takes every feature whose name begins so for an output or an input of the policy."""

INDEX_FEATURES = {
    "timestamp": "float32",
    "frame_index": "int64",
    "episode_index": "int64",
    "index": "int64",
    "task_index": "int64",
}
"""Features that every LeRobot dataset ends with, and their types."""

EPISODES_A_WRITE = 200

LOADING = """\
from lerobot.datasets.lerobot_dataset import LeRobotDataset

window = {"action": [step / FPS for step in range(16)]}
dataset = LeRobotDataset("local/go2", root="THIS FOLDER", delta_timestamps=window)
state, actions = dataset[0]["observation.state"], dataset[0]["action"]  # [34], [16, 12]
"""


def lerobot_fields(motion: Motion) -> list[Field]:
    """Return the features of a dataset, besides ``INDEX_FEATURES``."""
    others = [name for name in motion.row_arrays if name not in {*STATE_ARRAYS, "action"}]
    return [
        joined_field(motion, STATE_ARRAYS, "observation.state"),
        array_field(motion, "action"),
        *(array_field(motion, name, f"policy.{name}" if name.startswith(POLICY_PREFIXES) else name) for name in others),
    ]


def write_lerobot(
    dataset: Dataset,
    folder: Path,
    on_trajectory: Callable[[int, int], None] | None = None,
    file_bytes: int = FILE_MEGABYTES * 2**20,
) -> list[Field]:
    """Write a dataset as LeRobot's: an episode a trajectory, a task a motion.

    Args:
        dataset: What to write.
        folder: Where; it exists and is empty.
        on_trajectory: Called with the trajectories written and their total.
        file_bytes: Size at which the next file of data begins.

    Returns:
        The features, besides ``INDEX_FEATURES``.

    Raises:
        ExportError: the rate is not a whole number of frames a second, or a value is not a finite number.
        DatasetError: an array cannot be read.
    """
    if dataset.rate != round(dataset.rate):
        raise ExportError(f"{dataset.path}: LeRobot wants a whole number of frames a second, not {dataset.rate}")
    fields = lerobot_fields(dataset.motion(dataset.references[0].motion))
    tasks = list(dict.fromkeys(one.motion for one in dataset.references))
    arrays = tuple(name for field in fields for name in field.arrays)
    total = EpisodeStatistics({})
    rows = 0
    with (
        RollingParquet(folder / "data", file_bytes) as data,
        EpisodeWriter(RollingParquet(folder / "meta" / "episodes")) as episodes,
    ):
        for number, one in enumerate(dataset.trajectories(arrays=arrays)):
            columns = episode_columns(one, fields, number, rows, tasks.index(one.motion), dataset.rate)
            check_finite(dataset, one, columns)
            found = episode_statistics(columns)
            total = merged_statistics(total, found)
            episodes.add(one, number, rows, data.place(), found)
            data.write(as_table(columns))
            rows += one.length
            if on_trajectory is not None:
                on_trajectory(number + 1, len(dataset.references))
    write_tasks(tasks, folder / "meta" / "tasks.parquet")
    write_json(total.as_json(), folder / "meta" / "stats.json")
    write_json(information(dataset, fields, rows, len(tasks)), folder / "meta" / "info.json")
    return fields


def information(dataset: Dataset, fields: list[Field], rows: int, num_tasks: int) -> dict[str, Any]:
    """Return the content of ``meta/info.json``."""
    features: dict[str, Any] = {
        field.name: {"dtype": "float32", "shape": [len(field.columns)], "names": list(field.columns)}
        for field in fields
    }
    features |= {name: {"dtype": kind, "shape": [1], "names": None} for name, kind in INDEX_FEATURES.items()}
    num_episodes = len(dataset.references)
    return {
        "codebase_version": CODEBASE_VERSION,
        "fps": round(dataset.rate),
        "features": features,
        "total_episodes": num_episodes,
        "total_frames": rows,
        "total_tasks": num_tasks,
        "chunks_size": FILES_A_CHUNK,
        "data_files_size_in_mb": FILE_MEGABYTES,
        "video_files_size_in_mb": 200,
        "data_path": f"data/{PATH_TEMPLATE}",
        "video_path": None,
        "robot_type": dataset.attributes["robot"],
        "splits": {"train": f"0:{num_episodes}"},
    }


def episode_columns(
    one: Trajectory, fields: list[Field], episode: int, first_row: int, task: int, rate: float
) -> dict[str, NDArray[Any]]:
    """Return all features of an episode, those with names of shape [length, num_columns], the others [length]."""
    frames = np.arange(one.length, dtype=np.int64)
    columns = {field.name: field.values(one.arrays) for field in fields}
    return columns | {
        "timestamp": (frames / rate).astype(np.float32),
        "frame_index": frames,
        "episode_index": np.full(one.length, episode, dtype=np.int64),
        "index": first_row + frames,
        "task_index": np.full(one.length, task, dtype=np.int64),
    }


def check_finite(dataset: Dataset, one: TrajectoryReference, columns: dict[str, NDArray[Any]]) -> None:
    """Check that an episode holds finite numbers only, without which its statistics would be useless.

    Raises:
        ExportError: it does not; the message names trajectory, feature and row.
    """
    for name, values in columns.items():
        finite = np.isfinite(values.reshape(one.length, -1)).all(axis=1)
        if not finite.all():
            where = f"{dataset.path}/{one.motion}: trajectory {one.index}, row {int(np.argmin(finite))}"
            raise ExportError(f"{where}: {name} is not finite; leave the motion out, or gather it again")


def as_table(columns: dict[str, NDArray[Any]]) -> pa.Table:
    """Return columns as LeRobot stores them: lists of fixed size, and plain numbers for a single one."""
    arrays = {}
    for name, values in columns.items():
        flat = pa.array(values.reshape(-1))
        width = 1 if values.ndim == 1 else values.shape[1]
        arrays[name] = flat if width == 1 else pa.FixedSizeListArray.from_arrays(flat, width)
    return pa.table(arrays)


class EpisodeWriter:
    """Writes ``meta/episodes``, a row an episode. Use it as a context manager."""

    def __init__(self, files: RollingParquet) -> None:
        self.files = files
        self._rows: list[dict[str, Any]] = []

    def __enter__(self) -> "EpisodeWriter":
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self._flush()
        self.files.__exit__(None, None, None)

    def add(
        self,
        one: TrajectoryReference,
        episode: int,
        first_row: int,
        place: tuple[int, int],
        statistics: EpisodeStatistics,
    ) -> None:
        """Add an episode.

        Args:
            one: The trajectory; what is stored once of it goes along, so that episodes can be filtered by it.
            episode: Its number.
            first_row: Its first row among all.
            place: Numbers of chunk and file with its data.
            statistics: Of its features.
        """
        row: dict[str, Any] = {
            "episode_index": episode,
            "tasks": [one.motion],
            "length": one.length,
            "data/chunk_index": place[0],
            "data/file_index": place[1],
            "dataset_from_index": first_row,
            "dataset_to_index": first_row + one.length,
            "trajectory": one.index,
        }
        single = {name: np.asarray(value) for name, value in one.values.items() if name != "length"}
        row |= {f"kine2go/{name}": value.tolist() for name, value in single.items()}
        row |= statistics.as_columns()
        self._rows.append(row)
        if len(self._rows) == EPISODES_A_WRITE:
            self._flush()

    def _flush(self) -> None:
        chunk, file = self.files.place()
        rows = [{**row, "meta/episodes/chunk_index": chunk, "meta/episodes/file_index": file} for row in self._rows]
        if rows:
            self.files.write(pa.Table.from_pylist(rows))
        self._rows.clear()


def write_tasks(tasks: list[str], path: Path) -> None:
    """Write the tasks as LeRobot reads them: a table of pandas whose index is the text of the task."""

    def column(name: str, kind: str, numpy_kind: str) -> dict[str, Any]:
        return {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy_kind, "metadata": None}

    note = {
        "index_columns": ["task"],
        "column_indexes": [],
        "columns": [column("task_index", "int64", "int64"), column("task", "unicode", "object")],
        "pandas_version": "2.0.0",
    }
    table = pa.table({"task_index": pa.array(range(len(tasks)), pa.int64()), "task": pa.array(tasks, pa.string())})
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table.replace_schema_metadata({"pandas": json.dumps(note)}), path)


def write_json(content: Any, path: Path) -> None:
    """Write JSON that people can read."""
    path.write_text(json.dumps(content, indent=4))
