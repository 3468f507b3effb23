"""The layout of a LeRobot dataset, version 3.0, without video."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from kine2go_warp.dataset.access import Dataset
from kine2go_warp.dataset.motion import Motion, Trajectory, TrajectoryReference
from kine2go_warp.errors import ExportError
from kine2go_warp.exports.features import Field, stored
from kine2go_warp.exports.lerobot_statistics import EpisodeStatistics, episode_statistics, merged_statistics
from kine2go_warp.exports.rolling import FILE_MEGABYTES, FILES_A_CHUNK, PATH_TEMPLATE, RollingParquet, as_table
from kine2go_warp.exports.target import Output, Target, check_finite, learning_fields, task_sentence, write_json

CODEBASE_VERSION = "v3.0"

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

ABOUT_PREFIX = "kine2go/"
"""Stands in ``meta/episodes`` before the names of what the dataset stores once a trajectory."""

EPISODES_A_WRITE = 200

LOADING = """\
from lerobot.datasets.lerobot_dataset import LeRobotDataset

window = {"action": [step / {rate} for step in range(16)]}
dataset = LeRobotDataset("local/go2", root="{folder}", delta_timestamps=window)
state, actions = dataset[0]["observation.state"], dataset[0]["action"]  # [34], [16, 12]
"""


def lerobot_fields(motion: Motion) -> list[Field]:
    """Return the features of a dataset, besides ``INDEX_FEATURES``."""
    others = [name for name in motion.row_arrays if name != "action"]
    return [
        *learning_fields(motion),
        *(stored(motion, name, f"policy.{name}" if name.startswith(POLICY_PREFIXES) else name) for name in others),
    ]


def check_rate(dataset: Dataset) -> None:
    """Check that LeRobot can hold the rate of a dataset.

    Raises:
        ExportError: it is no whole number of frames a second.
    """
    if dataset.rate != round(dataset.rate):
        raise ExportError(f"{dataset.path}: LeRobot wants a whole number of frames a second, not {dataset.rate}")


def write_motion(
    output: Output, motion: str, trajectories: Iterator[Trajectory], file_bytes: int = FILE_MEGABYTES * 2**20
) -> None:
    """Write a motion as a task, and each of its trajectories as an episode.

    Args:
        output: Where, and what besides.
        motion: Its name.
        trajectories: Its trajectories.
        file_bytes: Size at which the next file of data begins.

    Raises:
        ExportError: a value is not a finite number.
        DatasetError: an array cannot be read.
    """
    episode, row = output.before(motion)
    task = output.motions.index(motion)
    sentence = task_sentence(output.dataset.motion(motion))
    with (
        RollingParquet(output.folder / "data", file_bytes) as data,
        EpisodeWriter(RollingParquet(output.folder / "meta" / "episodes"), sentence) as episodes,
    ):
        for number, one in enumerate(trajectories, start=episode):
            check_finite(output, one)
            columns = episode_columns(one, output.fields, number, row, task, output.dataset.rate)
            episodes.add(one, number, row, data.place(), episode_statistics(columns))
            data.write(as_table(columns))
            row += one.length


def finish(output: Output) -> None:
    """Write what LeRobot keeps of all episodes together."""
    meta = output.folder / "meta"
    names = [*(field.name for field in output.fields), *INDEX_FEATURES]
    total = EpisodeStatistics({})
    for path in sorted((meta / "episodes").rglob("*.parquet")):
        for row in pq.read_table(path).to_pylist():
            total = merged_statistics(total, EpisodeStatistics.from_columns(row, names))
    write_tasks([task_sentence(output.dataset.motion(name)) for name in output.motions], meta / "tasks.parquet")
    write_json(total.as_json(), meta / "stats.json", indent=4)
    write_json(information(output), meta / "info.json", indent=4)


def information(output: Output) -> dict[str, Any]:
    """Return the content of ``meta/info.json``."""
    dataset = output.dataset
    features: dict[str, Any] = {
        field.name: {"dtype": "float32", "shape": [len(field.columns)], "names": list(field.columns)}
        for field in output.fields
    }
    features |= {name: {"dtype": kind, "shape": [1], "names": None} for name, kind in INDEX_FEATURES.items()}
    num_episodes = len(dataset.references)
    return {
        "codebase_version": CODEBASE_VERSION,
        "fps": round(dataset.rate),
        "features": features,
        "total_episodes": num_episodes,
        "total_frames": dataset.num_rows,
        "total_tasks": len(output.motions),
        "chunks_size": FILES_A_CHUNK,
        "data_files_size_in_mb": FILE_MEGABYTES,
        "video_files_size_in_mb": 200,
        "data_path": f"data/{PATH_TEMPLATE}",
        "video_path": None,
        "robot_type": dataset.attributes["robot"],
        "splits": {"train": f"0:{num_episodes}"},
    }


def episode_columns(
    one: Trajectory, fields: Sequence[Field], episode: int, first_row: int, task: int, rate: float
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


class EpisodeWriter:
    """Writes ``meta/episodes``, a row an episode. Use it as a context manager."""

    def __init__(self, files: RollingParquet, task: str) -> None:
        self.files, self.task = files, task
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
            "tasks": [self.task],
            "length": one.length,
            "data/chunk_index": place[0],
            "data/file_index": place[1],
            "dataset_from_index": first_row,
            "dataset_to_index": first_row + one.length,
            "motion": one.motion,
            "trajectory": one.index,
        }
        single = {name: np.asarray(value) for name, value in one.values.items() if name != "length"}
        row |= {f"{ABOUT_PREFIX}{name}": value.tolist() for name, value in single.items()}
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


LEROBOT = Target(
    title="LeRobot dataset v3.0",
    write=write_motion,
    finish=finish,
    check=check_rate,
    fields=lerobot_fields,
    loading=LOADING,
    time_rule="A row is a control step. An episode is a trajectory, a task the sentence that describes its motion.",
    about="Columns of `meta/episodes`.",
    about_prefix=ABOUT_PREFIX,
    tags=("LeRobot",),
    data_files="data/*/*.parquet",
)
