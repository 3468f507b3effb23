"""What the bench measures is the reading of the same windows."""

import sys
from contextlib import ExitStack

import numpy as np
import pytest

from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.bench import METHODS, LoadingBench, Material, hdf5_read, measure_loading, npz_read, zarr_read
from kine2go_warp.dataset.memory import load_rows
from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.robots import GO2
from tests.dataset.test_store import SIMULATION, made_up

QUICK = LoadingBench(rows=8, batch_size=4, arrays=("action", "phase"), repeats=3, seconds=0.001)


@pytest.fixture
def dataset(tmp_path, rng):
    DatasetWriter(tmp_path / "dataset.zarr", GO2).write("one", made_up(rng), SIMULATION, {"rejected": {}})
    return open_dataset(tmp_path / "dataset.zarr").select(where=lambda one: one.index > 0)


@pytest.mark.parametrize("make", [zarr_read, hdf5_read, npz_read])
def test_every_format_gives_the_rows_of_the_dataset(dataset, make, tmp_path):
    with ExitStack() as stack:
        read = make(Material(dataset, load_rows(dataset, QUICK.arrays), QUICK, tmp_path, stack))
        for window in dataset.windows(8, 1, arrays=QUICK.arrays):
            found = read(window.motion, window.index, window.start)
            for name, values in zip(QUICK.arrays, found, strict=True):
                np.testing.assert_array_equal(values, window.arrays[name])


def test_every_way_is_measured_with_median_and_spread(dataset):
    seen = []
    rates = measure_loading(dataset, QUICK, lambda done, total: seen.append((done, total)))
    assert [rate.method for rate in rates] == list(METHODS)
    assert seen[-1] == (len(METHODS), len(METHODS))
    for rate in rates:
        assert 0.0 < rate.slowest <= rate.windows_per_second <= rate.fastest
        assert rate.megabytes_per_second == pytest.approx(rate.windows_per_second * 8 * 13 * 4 / 1e6)


def test_a_package_that_is_missing_costs_its_row_alone(dataset, monkeypatch):
    monkeypatch.setitem(sys.modules, "h5py", None)
    rates = {rate.method: rate for rate in measure_loading(dataset, QUICK)}
    assert rates["hdf5"].windows_per_second == 0.0
    assert "h5py is not installed" in rates["hdf5"].note
    assert rates["npz"].windows_per_second > 0.0
