"""Statistics in one pass, compared with NumPy over all rows at once."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.schema import ROW_ARRAYS
from kine2go_warp.dataset.statistics import compute_moments, compute_statistics, load_statistics, merge, save_statistics
from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.errors import DatasetError
from kine2go_warp.robots import GO2
from tests.dataset.test_store import SIMULATION, made_up


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    path, rng = tmp_path_factory.mktemp("data") / "dataset.zarr", np.random.default_rng(0)
    for name in ("one", "two"):
        DatasetWriter(path, GO2).write(name, made_up(rng), SIMULATION, {"rejected": {}})
    return open_dataset(path)


def test_figures_of_every_array_agree_with_numpy_over_all_rows(dataset):
    found = compute_statistics(dataset)
    assert set(found) == {array.name for array in ROW_ARRAYS}
    for name, one in found.items():
        rows = np.concatenate([part.arrays[name] for part in dataset.trajectories(arrays=[name])]).astype(np.float64)
        assert np.all(one.count == 110)
        np.testing.assert_allclose(one.mean, rows.mean(axis=0), rtol=1e-12, atol=1e-13)
        np.testing.assert_allclose(one.std, rows.std(axis=0), rtol=1e-12)
        np.testing.assert_array_equal(one.minimum, rows.min(axis=0))
        np.testing.assert_array_equal(one.maximum, rows.max(axis=0))


numbers = st.lists(st.floats(-1e3, 1e3, width=32) | st.just(float("nan")), max_size=20)


@given(numbers, numbers)
def test_merging_gives_what_all_values_together_give(first, second):
    together = compute_moments(np.array([*first, *second]))
    merged = merge(compute_moments(np.array(first)), compute_moments(np.array(second)))
    known = [value for value in (*first, *second) if not np.isnan(value)]
    assert merged.count == together.count == len(known)
    np.testing.assert_allclose(merged.mean, np.mean(known) if known else 0.0, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(merged.std, np.std(known) if known else 0.0, rtol=1e-6, atol=1e-6)
    assert merged.minimum == (min(known) if known else np.inf)


def test_a_small_spread_far_from_zero_is_not_lost(rng):
    values = 1e7 + rng.normal(0.0, 1e-2, (50, 200))
    total = compute_moments(values[0])
    for part in values[1:]:
        total = merge(total, compute_moments(part))
    assert float(total.std) == pytest.approx(values.std(), rel=1e-6)


def test_normalised_values_have_mean_zero_and_spread_one_but_for_constant_columns(dataset):
    one = compute_statistics(dataset, ["action"])["action"]
    rows = np.concatenate([part.arrays["action"] for part in dataset.trajectories(arrays=["action"])])
    normal = one.normalise(rows)
    np.testing.assert_allclose(normal.mean(axis=0), 0.0, atol=1e-6)
    np.testing.assert_allclose(normal.std(axis=0), 1.0, rtol=1e-5)
    constant = compute_statistics(dataset, ["action"])["action"]
    constant.std[:] = 0.0
    np.testing.assert_allclose(constant.normalise(constant.mean), 0.0)


def test_they_come_back_from_json_as_they_were(dataset, tmp_path):
    written = compute_statistics(dataset, ["action", "phase", "link_position"])
    save_statistics(written, tmp_path / "statistics.json")
    back = load_statistics(tmp_path / "statistics.json")
    assert list(back) == list(written)
    for name, one in written.items():
        for figure in ("count", "mean", "std", "minimum", "maximum"):
            np.testing.assert_array_equal(getattr(back[name], figure), getattr(one, figure))
        assert (back[name].columns, back[name].unit) == (one.columns, one.unit)
    content = json.loads((tmp_path / "statistics.json").read_text())
    assert content["arrays"]["link_position"]["columns"][0] == "FL_hip.x"


def test_wrong_files_and_empty_selections_are_refused(dataset, tmp_path):
    with pytest.raises(DatasetError, match="no such file of statistics"):
        load_statistics(tmp_path / "none.json")
    for content in ("{", "[]", '{"format": "other"}', '{"format": "kine2go statistics", "arrays": {"action": {}}}'):
        (tmp_path / "wrong.json").write_text(content)
        with pytest.raises(DatasetError, match=r"wrong\.json: not a file of statistics"):
            load_statistics(tmp_path / "wrong.json")
    with pytest.raises(DatasetError, match="statistics of nothing"):
        compute_statistics(dataset.select(where=lambda _: False))
