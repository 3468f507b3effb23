"""Flat Parquet: a table of rows and a table of trajectories, which the Hugging Face Hub shows and streams."""

from collections.abc import Iterator

import numpy as np
import pyarrow as pa

from kine2go_warp.dataset.motion import Motion, Trajectory
from kine2go_warp.exports.features import REWARD, Field, joined, stored
from kine2go_warp.exports.rolling import RollingParquet, as_table
from kine2go_warp.exports.target import Output, Target, check_finite, learning_fields, task_sentence

LOADING = """\
from datasets import load_dataset

rows = load_dataset("{folder}", split="train")  # streaming=True reads a part at a time
state, action = rows[0]["observation.state"], rows[0]["action"]  # 34 and 12 numbers
trajectories = load_dataset("{folder}", "trajectories", split="train")  # noise, quality/joint_rmse, ...
"""


def parquet_fields(motion: Motion) -> list[Field]:
    """Return the columns of the table of rows that hold numbers of the dataset."""
    others = [name for name in motion.row_arrays if name not in ("action", "reward")]
    return [
        *learning_fields(motion),
        joined(motion, [REWARD], "reward"),
        stored(motion, "reward", "reward_terms"),
        *(stored(motion, name) for name in others),
    ]


def write_motion(output: Output, name: str, trajectories: Iterator[Trajectory]) -> None:
    """Write the rows of a motion to ``data/MOTION`` and its trajectories to ``trajectories/MOTION``.

    Raises:
        ExportError: a value is not a finite number.
        DatasetError: an array cannot be read.
    """
    sentence = task_sentence(output.dataset.motion(name))
    about = []
    with RollingParquet(output.folder / "data" / name) as files:
        for one in trajectories:
            check_finite(output, one)
            files.write(table_of(output, one))
            single = {key: np.asarray(value).tolist() for key, value in one.values.items()}
            about.append({"motion": name, "trajectory": one.index, "task": sentence, **single})
    with RollingParquet(output.folder / "trajectories" / name) as files:
        files.write(pa.Table.from_pylist(about))


def table_of(output: Output, one: Trajectory) -> pa.Table:
    """Return the rows of a trajectory as a table, whose columns say unit and meaning."""
    frames = np.arange(one.length)
    places = {
        "motion": pa.array([one.motion] * one.length),
        "trajectory": pa.array(np.full(one.length, one.index, np.int32)),
        "frame": pa.array(frames.astype(np.int32)),
        "time": pa.array(frames / output.dataset.rate),
        "terminated": pa.array((frames == one.length - 1) & bool(one.values["terminated"])),
    }
    values = {field.name: field.values(one.arrays) for field in output.fields}
    numbers = as_table(values)
    described = [
        numbers.schema.field(field.name).with_metadata(
            {
                "unit": ", ".join(dict.fromkeys(feature.unit for feature in field.features)),
                "content": "; ".join(feature.content for feature in field.features),
                "columns": ", ".join(field.columns),
            }
        )
        for field in output.fields
    ]
    table = pa.table(places)
    for column, schema in zip(numbers.columns, described, strict=True):
        table = table.append_column(schema, column)
    return table


PARQUET = Target(
    title="flat Parquet, a table of rows and one of trajectories",
    write=write_motion,
    fields=parquet_fields,
    loading=LOADING,
    time_rule="A row is a control step; `terminated` is true in the last row of a rollout that ended early.",
    about="Columns of the table `trajectories`.",
    data_files="data/**/*.parquet",
)
