"""Rollouts that gathering rejected, for those who ask for them."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest

from kine2go_warp.cli.main import main
from kine2go_warp.dataset import load_rows, open_dataset
from kine2go_warp.dataset.writer import DatasetWriter, RejectedRollouts
from kine2go_warp.robots import GO2
from tests.dataset.test_store import SIMULATION, made_up

REASONS = ["distance", "body_contact", "distance"]


@pytest.fixture
def written(rng, tmp_path):
    """Three accepted and three rejected rollouts of 20, 15 and 20 rows each, and the store with both."""
    accepted, rejected = made_up(rng), made_up(rng)
    store = tmp_path / "store.zarr"
    DatasetWriter(store, GO2).write(
        "one", accepted, SIMULATION, {"rejected": {"distance": 2, "body_contact": 1}},
        RejectedRollouts(rejected, REASONS),
    )  # fmt: skip
    return accepted.padded(), rejected.padded(), store


def test_they_follow_the_accepted_ones_with_their_reasons(written):
    accepted, rejected, store = written
    data = open_dataset(store, include_rejected=True)
    assert [one.values["reason"] for one in data.references] == ["", "", "", *REASONS]
    assert [one.length for one in data.references] == [20, 15, 20, 20, 15, 20]
    for one in data.trajectories():
        source, place = (accepted, one.index) if one.index < 3 else (rejected, one.index - 3)
        for name, values in one.arrays.items():
            np.testing.assert_array_equal(values, source.rows[name][place, : one.length], err_msg=name)
        for name, values in source.draws.items():
            assert one.values[name] == values[place].astype(one.values[name].dtype), name
        np.testing.assert_array_equal(
            one.values["initial_state/joint_q"], source.groups["initial_state"]["joint_q"][place].astype(np.float32)
        )


def test_nobody_meets_them_who_did_not_ask(written):
    data = open_dataset(written[2])
    assert [one.index for one in data.references] == [0, 1, 2]
    assert "reason" not in data.references[0].values
    assert data.load("one").trajectories.num_trajectories == 3


@pytest.mark.parametrize("indices", [[3], [4, 5], [0, 2, 3], [1, 5]])
def test_any_of_them_are_read_without_the_others(written, indices):
    data = open_dataset(written[2], include_rejected=True).select(where=lambda one: one.index in indices)
    assert [one.index for one in data.trajectories(arrays=["action"])] == indices
    whole = open_dataset(written[2], include_rejected=True).load("one").trajectories.rows["action"]
    packed = load_rows(data, ["action"])
    for place, index in enumerate(indices):
        start, length = packed.first_rows[place], data.references[place].length
        np.testing.assert_array_equal(packed.array("action")[start : start + length], whole[index, :length])


def test_a_split_of_the_accepted_ones_is_the_same_with_and_without_them(written):
    plain, whole = (open_dataset(written[2], include_rejected=asked).split(0.34, seed=3)[1] for asked in (False, True))
    assert [one.index for one in whole.references if not one.values["reason"]] == [
        one.index for one in plain.references
    ]
    assert any(one.values["reason"] for one in whole.references)


def test_exports_hold_them_with_the_reason(written, tmp_path):
    store = str(written[2])
    assert main(["export", store, "--format", "npz", "--include-rejected", "--out", str(tmp_path / "npz")]) == 0
    files = sorted((tmp_path / "npz" / "one").iterdir())
    assert [str(np.load(file, allow_pickle=False)["reason"]) for file in files] == ["", "", "", *REASONS]
    assert main(["export", store, "--format", "lerobot", "--include-rejected", "--out", str(tmp_path / "le")]) == 0
    (episodes,) = (tmp_path / "le" / "meta" / "episodes").rglob("*.parquet")
    assert pq.read_table(episodes)["kine2go/reason"].to_pylist() == ["", "", "", *REASONS]
    assert json.loads((tmp_path / "le" / "meta" / "info.json").read_text())["total_episodes"] == 6
    assert "why the rollout was rejected" in (tmp_path / "le" / "README.md").read_text()
    assert main(["export", store, "--format", "npz", "--out", str(tmp_path / "plain")]) == 0
    assert json.loads((tmp_path / "plain" / "export.json").read_text())["trajectories"] == 3


def test_final_states_that_no_rejected_rollout_reached_are_not_taken_for_lost_data(rng, tmp_path, capsys):
    accepted, rejected = made_up(rng), made_up(rng)
    for values in rejected.groups["final_state"].values():
        if values.dtype.kind == "f":
            values[...] = np.nan
    store = tmp_path / "store.zarr"
    rows = {"rejected": {"distance": 2, "body_contact": 1}}
    DatasetWriter(store, GO2).write("one", accepted, SIMULATION, rows, RejectedRollouts(rejected, REASONS))
    main(["dataset", "check", str(store)])
    assert "data are missing" not in capsys.readouterr().out
