"""A dataset by trajectory and by window, compared with the arrays that were written."""

import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kine2go_warp.dataset import motion as motion_module
from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.schema import QUALITY_ARRAYS, ROW_ARRAYS, TRAJECTORY_ARRAYS
from kine2go_warp.dataset.writer import DatasetWriter, consolidate
from kine2go_warp.errors import DatasetError
from kine2go_warp.robots import GO2
from tests.dataset.test_store import SIMULATION, made_up
from tests.test_architecture import run_without

LENGTHS = [20, 15, 20]


@pytest.fixture(scope="module")
def written():
    """Two motions; the middle trajectory of each is short and without noise."""
    rng = np.random.default_rng(0)
    motions = {}
    for name in ("one", "two"):
        data = made_up(rng)
        motions[name] = replace(data, draws={**data.draws, "noise": np.array([1.0, 0.0, 1.0])})
    return motions


@pytest.fixture(scope="module")
def pristine(written, tmp_path_factory):
    """The dataset, not to be changed."""
    path = tmp_path_factory.mktemp("pristine") / "dataset.zarr"
    for name, data in written.items():
        DatasetWriter(path, GO2).write(name, data, SIMULATION, {"rejected": {}, "licence": "CC0"})
    return path


@pytest.fixture
def store(pristine, tmp_path):
    """A copy of the dataset."""
    return shutil.copytree(pristine, tmp_path / pristine.name)


def test_trajectories_come_back_bit_for_bit_and_without_padding(store, written):
    found = list(open_dataset(store).trajectories())
    assert [(one.motion, one.index, one.length) for one in found] == [
        (motion, index, length) for motion in ("one", "two") for index, length in enumerate(LENGTHS)
    ]
    for one in found:
        assert set(one.arrays) == {array.name for array in ROW_ARRAYS}
        for name, values in one.arrays.items():
            assert values.dtype == np.float32
            np.testing.assert_array_equal(values, written[one.motion].rows[name][one.index, : one.length])


@pytest.mark.parametrize("block", [1, 2, 100])
def test_how_many_trajectories_are_read_at_once_changes_nothing(store, written, block, monkeypatch):
    monkeypatch.setattr(motion_module, "BLOCK", block)
    chosen = open_dataset(store).select(where=lambda one: one.index != 1)
    for one in chosen.trajectories(arrays=["action"]):
        np.testing.assert_array_equal(one.arrays["action"], written[one.motion].rows["action"][one.index])


def test_only_what_is_asked_for_is_read(store, monkeypatch):
    read = []
    original = motion_module.Motion._read
    monkeypatch.setattr(
        motion_module.Motion, "_read", lambda self, name, what: read.append(name) or original(self, name, what)
    )
    dataset = open_dataset(store)
    assert read == []
    list(dataset.trajectories(["two"], ["action", "phase"]))
    assert set(read) == {"length", "action", "phase"}


def test_what_is_stored_once_a_trajectory_is_known_of_each(store, written):
    dataset = open_dataset(store)
    reference = dataset.references[4]
    assert (reference.motion, reference.index) == ("two", 1)
    assert reference.values["heading"] == np.float32(written["two"].draws["heading"][1])
    quality = written["two"].groups["quality"]
    assert reference.values["quality/joint_rmse"] == quality["joint_rmse"][1]
    names = {array.name for array in TRAJECTORY_ARRAYS} | {f"quality/{array.name}" for array in QUALITY_ARRAYS}
    assert names <= set(reference.values)
    assert not set(reference.values) & {array.name for array in ROW_ARRAYS}


def test_names_of_columns_follow_the_order_of_memory(store):
    one = open_dataset(store).motion("one")
    assert one.column_names("phase") == ("phase",)
    assert one.column_names("joint_position") == GO2.joint_names
    assert one.column_names("foot_contact_force")[:4] == ("FL.x", "FL.y", "FL.z", "FR.x")
    for array in ROW_ARRAYS:
        values = next(one.read(one.references(), [array.name])).arrays[array.name]
        assert len(one.column_names(array.name)) == values[0].size


def test_trajectories_are_chosen_by_motion_and_by_what_is_known_of_them(store):
    dataset = open_dataset(store)
    calm = dataset.select(where=lambda one: one.values["noise"] == 0)
    assert [(one.motion, one.index) for one in calm.references] == [("one", 1), ("two", 1)]
    assert calm.num_rows == 30
    assert [one.motion for one in calm.select(["two"]).trajectories()] == ["two"]
    assert dataset.select(["two"]).motions == ["two"]
    assert len(dataset.select(["two", "one", "two"]).references) == 6


def test_every_window_is_a_piece_of_one_trajectory_and_none_is_missing(store, written):
    found = {(one.motion, one.index, one.start): one.arrays for one in open_dataset(store).windows(8, 3)}
    expected = {
        (motion, index, start)
        for motion in written
        for index, length in enumerate(LENGTHS)
        for start in range(length)
        if start % 3 == 0 and start + 8 <= length
    }
    assert set(found) == expected
    for (motion, index, start), arrays in found.items():
        np.testing.assert_array_equal(arrays["action"], written[motion].rows["action"][index, start : start + 8])
        assert not np.isnan(arrays["root_position"]).any()


def test_a_split_divides_whole_trajectories_and_stays_the_same(store, rng):
    def names(part):
        return {(one.motion, one.index) for one in part.references}

    dataset = open_dataset(store)
    train, validation = dataset.split(0.3, seed=1)
    assert names(train) | names(validation) == names(dataset)
    assert not names(train) & names(validation)
    assert {one.motion for one in validation.references} == {"one", "two"}
    assert names(open_dataset(store).split(0.3, seed=1)[1]) == names(validation)
    assert names(dataset.select(["two"]).split(0.3, seed=1)[1]) == {one for one in names(validation) if one[0] == "two"}
    DatasetWriter(store, GO2).write("another", made_up(rng), SIMULATION, {"rejected": {}})
    assert names(validation) <= names(open_dataset(store).split(0.3, seed=1)[1])
    assert len({frozenset(names(dataset.split(0.3, seed)[1])) for seed in range(20)}) > 1


def test_a_split_of_nothing_or_all_is_possible_and_others_are_refused(store):
    dataset = open_dataset(store)
    assert len(dataset.split(0.0)[1].references) == 0
    assert len(dataset.split(1.0)[0].references) == 0
    with pytest.raises(DatasetError, match="between 0 and 1"):
        dataset.split(1.5)


def test_rejected_rollouts_are_not_used(store, rng):
    before = open_dataset(store)
    other = store.with_name("other.zarr")
    DatasetWriter(other, GO2).write("one", made_up(rng), SIMULATION, {"rejected": {}})
    (other / "one").rename(store / "one" / "rejected")
    metadata = store / "one" / "zarr.json"
    consolidate(store / "one")
    assert "rejected/action" in metadata.read_text()
    after = open_dataset(store)
    assert after.num_rows == before.num_rows
    assert set(after.motion("one").arrays) == set(before.motion("one").arrays)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # the figures of its quality are of no rows
def test_an_empty_trajectory_is_left_out(tmp_path, rng):
    data = made_up(rng)
    draws = {**data.draws, "length": np.array([20, 0, 20], dtype=np.int32)}
    path = tmp_path / "dataset.zarr"
    DatasetWriter(path, GO2).write("one", replace(data, draws=draws), SIMULATION, {"rejected": {}})
    assert [one.index for one in open_dataset(path).references] == [0, 2]


def test_wrong_names_and_sizes_are_explained(store):
    dataset = open_dataset(str(store))
    with pytest.raises(DatasetError, match="holds no motion 'three'; it has: one, two"):
        list(dataset.trajectories(["three"]))
    with pytest.raises(DatasetError, match="one: holds no row array 'torque'; it has: action, "):
        list(dataset.trajectories(arrays=["torque"]))
    with pytest.raises(DatasetError, match="no array 'torque' of trajectories; it has: final_state/joint_position, "):
        dataset.select(where=lambda one: one.values["torque"] > 0)
    with pytest.raises(DatasetError, match="at least 1 row"):
        list(dataset.windows(0, 1))
    with pytest.raises(DatasetError, match="has no labels"):
        dataset.motion("one").labels("frame")
    with pytest.raises(DatasetError, match="no dataset here"):
        open_dataset("nowhere.zarr")


def test_damage_is_named_when_it_is_met(store):
    shard = next(path for path in (store / "one" / "action").rglob("*") if path.is_file() and path.name != "zarr.json")
    shard.write_bytes(shard.read_bytes()[:50])
    (store / "two" / "zarr.json").write_text("{")
    dataset = open_dataset(store)
    with pytest.raises(DatasetError, match="one/action: cannot be read"):
        list(dataset.trajectories(["one"], ["action"]))
    assert len(list(dataset.trajectories(["one"], ["phase"]))) == 3
    with pytest.raises(DatasetError, match="two: cannot be read"):
        dataset.motion("two")


def test_loading_needs_neither_torch_nor_warp(store):
    script = f"""
from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.memory import load_rows
from kine2go_warp.dataset.statistics import compute_statistics
dataset = open_dataset({str(store)!r})
assert len(load_rows(dataset).table) == 110 and compute_statistics(dataset, ["action"])
"""
    run_without(("torch", "warp", "newton", "placo", "pyarrow", "xarray", "rich"), script, Path(sys.prefix))
