"""The LeRobot export, read with pyarrow alone; ``loaders`` reads it with LeRobot itself."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import zarr

from kine2go_warp.dataset.schema import ROW_ARRAYS, TRAJECTORY_ARRAYS
from kine2go_warp.errors import ExportError
from kine2go_warp.exports import export as export_module
from kine2go_warp.exports.export import export_dataset
from kine2go_warp.exports.lerobot import LEROBOT, write_motion
from kine2go_warp.exports.rolling import RollingParquet
from kine2go_warp.robots import GO2
from tests.exports.conftest import LENGTHS, valid_rows
from tests.exports.loaders import DERIVED, trajectories

STARTS = [0, 20, 35, 55, 75, 90]


@pytest.fixture(scope="module")
def export(pristine, tmp_path_factory):
    folder = tmp_path_factory.mktemp("export") / "out"
    export_dataset(pristine, "lerobot", folder)
    return folder


def read_data(folder: Path) -> dict[str, np.ndarray]:
    """All features, each of shape [num_rows, num_columns]."""
    table = pa.concat_tables([pq.read_table(path) for path in sorted((folder / "data").rglob("*.parquet"))])
    columns = {}
    for name in table.column_names:
        column = table[name].combine_chunks()
        flat = column.flatten() if pa.types.is_fixed_size_list(column.type) else column
        columns[name] = flat.to_numpy().reshape(len(column), -1)
    return columns


def read_info(folder: Path) -> dict:
    return json.loads((folder / "meta" / "info.json").read_text())


def read_episodes(folder: Path) -> list[dict]:
    return pq.read_table(folder / "meta" / "episodes").to_pylist()


def test_every_number_is_that_of_the_dataset(export, written, store):
    data = read_data(export)
    expected = [rows for motion in ("one", "two") for rows in trajectories(store, motion)]
    for name, source in (("observation.state", "state"), ("observation.environment_state", "goal")):
        np.testing.assert_allclose(data[name], np.concatenate([rows[source] for rows in expected]), atol=DERIVED)
    for array in ROW_ARRAYS:
        name = "policy.action_mean" if array.name == "action_mean" else array.name
        assert data[name].dtype == np.float32
        np.testing.assert_array_equal(data[name], valid_rows(written, array.name))


def test_indices_count_rows_episodes_and_tasks(export):
    data = {name: values[:, 0] for name, values in read_data(export).items()}
    np.testing.assert_array_equal(data["index"], np.arange(110))
    np.testing.assert_array_equal(data["episode_index"], np.repeat(np.arange(6), LENGTHS * 2))
    np.testing.assert_array_equal(data["task_index"], np.repeat([0, 1], 55))
    np.testing.assert_array_equal(data["frame_index"], np.concatenate([np.arange(length) for length in LENGTHS * 2]))
    np.testing.assert_allclose(data["timestamp"], data["frame_index"] / 60.0, rtol=1e-6)


def test_info_describes_the_columns_that_are_there(export):
    info, data = read_info(export), read_data(export)
    assert info["codebase_version"] == "v3.0"
    assert (info["fps"], info["robot_type"], info["video_path"]) == (60, "go2", None)
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (6, 110, 2)
    assert info["splits"] == {"train": "0:6"}
    assert list(info["features"]) == list(data)
    for name, feature in info["features"].items():
        assert feature["shape"] == [data[name].shape[1]], name
        assert feature["dtype"] == str(data[name].dtype), name
        assert feature["names"] is None or len(feature["names"]) == feature["shape"][0], name
    state = info["features"]["observation.state"]["names"]
    assert state[:5] == ["height", *(f"gravity.{axis}" for axis in "xyz"), "linear_velocity.x"]
    assert info["features"]["action"]["names"] == list(GO2.joint_names)


def test_lerobot_takes_the_state_and_the_action_alone_for_those_of_the_policy(export):
    names = read_info(export)["features"]
    assert [name for name in names if name.startswith("observation")] == [
        "observation.state", "observation.environment_state",
    ]  # fmt: skip
    assert [name for name in names if name.startswith("action")] == ["action"]


def test_episodes_tell_where_their_rows_are_and_how_they_were_drawn(export, written):
    episodes, info = read_episodes(export), read_info(export)
    assert [one["episode_index"] for one in episodes] == list(range(6))
    assert [one["motion"] for one in episodes] == ["one"] * 3 + ["two"] * 3
    assert len({one["tasks"][0] for one in episodes}) == 2
    assert all(len(one["tasks"]) == 1 for one in episodes)
    assert [one["dataset_from_index"] for one in episodes] == STARTS
    assert [one["dataset_to_index"] for one in episodes] == [*STARTS[1:], 110]
    for one in episodes:
        path = export / info["data_path"].format(chunk_index=one["data/chunk_index"], file_index=one["data/file_index"])
        rows = pq.read_table(path, filters=[("episode_index", "=", one["episode_index"])])
        assert len(rows) == one["length"]
        draws = written[one["motion"]].draws
        for array in TRAJECTORY_ARRAYS:
            if array.name != "length":
                drawn = draws[array.name][one["trajectory"]]
                assert one[f"kine2go/{array.name}"] == pytest.approx(drawn, rel=1e-6)


def test_statistics_agree_with_numpy(export):
    data, info = read_data(export), read_info(export)
    total = json.loads((export / "meta" / "stats.json").read_text())
    assert set(total) == set(info["features"])
    for name, values in data.items():
        rows = values.astype(np.float64)
        assert total[name]["count"] == [110]
        for figure in ("mean", "std", "min", "max"):
            expected = getattr(np, figure)(rows, axis=0)
            np.testing.assert_allclose(total[name][figure], expected, rtol=1e-9, atol=1e-12)
    for one in read_episodes(export):
        part = slice(one["dataset_from_index"], one["dataset_to_index"])
        for name, values in data.items():
            rows = values[part].astype(np.float64)
            assert one[f"stats/{name}/count"] == [one["length"]]
            np.testing.assert_allclose(one[f"stats/{name}/mean"], rows.mean(axis=0), rtol=1e-9, atol=1e-12)
            np.testing.assert_allclose(one[f"stats/{name}/std"], rows.std(axis=0), rtol=1e-9, atol=1e-12)
            np.testing.assert_allclose(one[f"stats/{name}/q90"], np.quantile(rows, 0.9, axis=0), rtol=1e-9, atol=1e-12)


def test_tasks_are_a_table_of_pandas_with_the_text_as_index(export):
    pandas = pytest.importorskip("pandas")
    tasks = pandas.read_parquet(export / "meta" / "tasks.parquet")
    assert [re.sub(r": .*", "", task) for task in tasks.index] == ["Repeat the motion one", "Repeat the motion two"]
    assert list(tasks["task_index"]) == [0, 1]
    assert [one["tasks"][0] for one in read_episodes(export)[::3]] == list(tasks.index)


def write_small(output, motion, some):
    write_motion(output, motion, some, file_bytes=30_000)


def test_large_data_are_cut_into_files_between_episodes(store, tmp_path, written, monkeypatch):
    folder = tmp_path / "cut"
    monkeypatch.setattr(export_module, "target_named", lambda _: replace(LEROBOT, write=write_small))
    export_dataset(store, "lerobot", folder)
    files = sorted(path.name for path in (folder / "data" / "chunk-000").iterdir())
    assert len(files) > 1
    places = [one["data/file_index"] for one in read_episodes(folder)]
    assert sorted(set(places)) == list(range(len(files)))
    for number, name in enumerate(files):
        found = pq.read_table(folder / "data" / "chunk-000" / name)["episode_index"].unique().to_pylist()
        assert found == [episode for episode, place in enumerate(places) if place == number]
    np.testing.assert_array_equal(read_data(folder)["action"], valid_rows(written, "action"))


def test_a_thousand_files_fill_a_chunk(tmp_path):
    table = pa.table({"value": [1]})
    with RollingParquet(tmp_path, file_bytes=1) as files:
        for number in range(1001):
            assert files.place() == divmod(number, 1000)
            files.write(table)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["chunk-000", "chunk-001"]


def test_a_rate_that_is_no_whole_number_is_refused(store, tmp_path):
    zarr.open_group(store, mode="a").attrs["control_frequency"] = 62.5
    with pytest.raises(ExportError, match=r"whole number of frames a second, not 62\.5"):
        export_dataset(store, "lerobot", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_what_is_not_finite_is_named(store, tmp_path):
    zarr.open_group(store / "two", mode="a")["joint_torque"][1, 7, 3] = np.inf
    with pytest.raises(ExportError, match="two: trajectory 1, row 7: joint_torque is not finite"):
        export_dataset(store, "lerobot", tmp_path / "out")
    assert [path.name for path in tmp_path.iterdir()] == [store.name]
