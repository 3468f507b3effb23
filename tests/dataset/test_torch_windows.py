"""Random windows for PyTorch, compared with the store."""

import time

import numpy as np
import pytest
from torch.utils.data import DataLoader

from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.memory import OBSERVATION_ARRAYS, load_rows
from kine2go_warp.dataset.torch_windows import WindowDataset, WindowLoader
from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.errors import DatasetError
from kine2go_warp.robots import GO2
from tests.dataset.test_store import SIMULATION, made_up

ARRAYS = ("action", "phase", "foot_contact_force")


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    path, rng = tmp_path_factory.mktemp("data") / "dataset.zarr", np.random.default_rng(0)
    for name in ("one", "two"):
        DatasetWriter(path, GO2).write(name, made_up(rng), SIMULATION, {"rejected": {}})
    return open_dataset(path)


@pytest.fixture
def packed(dataset):
    return load_rows(dataset, ARRAYS)


def as_keys(windows):
    """The actions of windows as bytes, by which each can be told from all others."""
    return [window.numpy().tobytes() for window in windows]


def expected_windows(dataset, rows, stride=1):
    return [np.ascontiguousarray(one.arrays["action"]).tobytes() for one in dataset.windows(rows, stride)]


def test_the_table_holds_the_rows_of_all_trajectories(dataset, packed):
    assert packed.table.flags.c_contiguous
    assert packed.table.shape == (110, 12 + 1 + 12)
    assert not np.isnan(packed.table).any()
    for name in ARRAYS:
        rows = np.concatenate([one.arrays[name] for one in dataset.trajectories(arrays=[name])])
        np.testing.assert_array_equal(packed.array(name), rows)


@pytest.mark.parametrize("stride", [1, 3])
def test_an_epoch_serves_every_window_once(dataset, packed, stride):
    loader = WindowLoader(packed, rows=8, batch_size=5, stride=stride, drop_last=False)
    batches = list(loader)
    assert len(batches) == len(loader)
    served = [key for batch in batches for key in as_keys(batch["action"])]
    assert sorted(served) == sorted(expected_windows(dataset, 8, stride))


def test_the_arrays_of_a_window_belong_together_and_have_their_shapes(dataset, packed):
    by_action = {
        np.ascontiguousarray(one.arrays["action"]).tobytes(): one.arrays for one in dataset.windows(8, 1, arrays=ARRAYS)
    }
    batch = next(iter(WindowLoader(packed, rows=8, batch_size=7)))
    assert {name: tuple(values.shape) for name, values in batch.items()} == {
        "action": (7, 8, 12),
        "phase": (7, 8),
        "foot_contact_force": (7, 8, 4, 3),
    }
    for number, key in enumerate(as_keys(batch["action"])):
        for name in ARRAYS:
            np.testing.assert_array_equal(batch[name][number], by_action[key][name])


def test_the_order_depends_on_seed_and_epoch_alone(packed):
    def epochs(seed):
        loader = WindowLoader(packed, rows=8, batch_size=5, seed=seed)
        return [[key for batch in loader for key in as_keys(batch["action"])] for _ in range(2)]

    first, second = epochs(3)
    assert epochs(3) == [first, second]
    assert first != second
    assert first != epochs(4)[0]
    continued = WindowLoader(packed, rows=8, batch_size=5, seed=3)
    continued.epoch = 1
    assert [key for batch in continued for key in as_keys(batch["action"])] == second


def test_without_shuffling_windows_come_in_order(dataset, packed):
    loader = WindowLoader(packed, rows=8, batch_size=4, shuffle=False, drop_last=False)
    assert [key for batch in loader for key in as_keys(batch["action"])] == expected_windows(dataset, 8)


def test_changing_a_batch_leaves_the_data_alone(packed):
    before = packed.table.copy()
    for batch in WindowLoader(packed, rows=8, batch_size=5):
        batch["action"] += 1.0
    np.testing.assert_array_equal(packed.table, before)


@pytest.mark.parametrize("workers", [0, 1])
def test_the_map_style_dataset_serves_the_same_windows_through_a_data_loader(dataset, packed, workers):
    windows = WindowDataset(packed, rows=8)
    assert len(windows) == len(expected_windows(dataset, 8))
    loader = DataLoader(windows, batch_size=5, num_workers=workers)
    assert [key for batch in loader for key in as_keys(batch["action"])] == expected_windows(dataset, 8)


def test_at_least_twenty_thousand_windows_a_second_are_served(tmp_path, rng):
    path = tmp_path / "long.zarr"
    DatasetWriter(path, GO2).write("one", made_up(rng, rows=2000), SIMULATION, {"rejected": {}})
    loader = WindowLoader(load_rows(open_dataset(path), OBSERVATION_ARRAYS), rows=32, batch_size=256)
    begin = time.perf_counter()
    served = sum(len(batch["action"]) for _ in range(4) for batch in loader)
    assert served > 20_000
    assert served / (time.perf_counter() - begin) > 20_000


def test_windows_that_cannot_be_are_refused(dataset, packed):
    assert len(packed.window_starts(20)) == 4, "one for each whole trajectory"
    with pytest.raises(DatasetError, match="no trajectory has 21 rows, as a window should; the longest has 20"):
        WindowDataset(packed, rows=21)
    with pytest.raises(DatasetError, match="at least 1 row"):
        WindowLoader(packed, rows=0, batch_size=4)
    with pytest.raises(DatasetError, match="at least 1 window"):
        WindowLoader(packed, rows=8, batch_size=0)
    with pytest.raises(DatasetError, match="fewer than a batch of 1000"):
        WindowLoader(packed, rows=8, batch_size=1000)
    with pytest.raises(DatasetError, match="'torque' was not loaded; loaded are: action, phase"):
        packed.array("torque")
    with pytest.raises(DatasetError, match="nothing to load"):
        load_rows(dataset.select(where=lambda _: False))
