"""What the benchmark of loading measures is the reading of the dataset's windows."""

import numpy as np
import pytest

from kine2go_warp.bench.loading import LoadingBench, measure_loading, serve_reads, zarr_read
from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.memory import load_rows
from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.robots import GO2
from tests.dataset.test_store import SIMULATION, made_up

QUICK = LoadingBench(rows=8, batch_size=4, arrays=("action", "phase"), repeats=3, seconds=0.001)


@pytest.fixture
def dataset(tmp_path, rng):
    DatasetWriter(tmp_path / "dataset.zarr", GO2).write("one", made_up(rng), SIMULATION, {"rejected": {}})
    return open_dataset(tmp_path / "dataset.zarr").select(where=lambda one: one.index > 0)


def test_windows_read_from_the_store_are_those_of_the_dataset(dataset):
    read = zarr_read(dataset, load_rows(dataset, QUICK.arrays), QUICK)
    for window in dataset.windows(8, 1, arrays=QUICK.arrays):
        found = read(window.motion, window.index, window.start)
        for name, values in zip(QUICK.arrays, found, strict=True):
            np.testing.assert_array_equal(values, window.arrays[name])


def test_random_reads_are_windows_that_lie_in_one_trajectory(dataset):
    packed, asked = load_rows(dataset, QUICK.arrays), []
    serve = serve_reads(lambda *window: asked.append(window) or [], packed, QUICK)
    for _ in range(200):
        serve()
    there = {(window.motion, window.index, window.start) for window in dataset.windows(8, 1, arrays=QUICK.arrays)}
    assert set(asked) <= there
    assert len(set(asked)) > 1


def test_every_way_is_measured_once_a_repeat(dataset):
    found = measure_loading(dataset, QUICK)
    assert [one.name for one in found] == ["batches from memory", "items from memory", "zarr"]
    for one in found:
        assert len(one.values) == 3
        assert 0.0 < one.spread[0] <= one.median <= one.spread[1]
        assert one.note == f"{8 * 13 * 4} bytes a window"
