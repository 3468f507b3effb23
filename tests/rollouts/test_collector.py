"""Batches of rollouts: how many are run, which are kept, what differs between them."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import xarray
import zarr

from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.checks.run import check_dataset
from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.env.terms.base import find_term
from kine2go_warp.env.terms.randomization import randomized
from kine2go_warp.errors import DatasetError
from kine2go_warp.robots import GO2
from kine2go_warp.rollouts.config import MILD, GatherConfig
from kine2go_warp.rollouts.gather import gather
from tests.conftest import ANYTHING_GOES
from tests.dataset.helpers import files_of

EVERYTHING = GatherConfig(trajectories=24, num_worlds=4, rows=24, warm_up=0.1, max_attempts=2.0, **ANYTHING_GOES)
"""Six batches, of which nothing is rejected."""


@pytest.fixture(scope="module")
def everything(policy, tmp_path_factory):
    path = tmp_path_factory.mktemp("collector") / "everything" / "dataset.zarr"
    gather(policy, DatasetWriter(path, GO2), EVERYTHING, "cpu")
    return open_dataset(path).load("dog_trot").trajectories


@pytest.fixture(scope="module")
def strict(everything):
    """Six are wanted; about every second rollout is good enough."""
    limit = float(np.median(everything.groups["quality"]["joint_rmse"]))
    return replace(EVERYTHING, trajectories=6, max_attempts=4.0, max_joint_rmse=limit, keep_rejected=True)


@pytest.fixture(scope="module")
def with_rejected(policy, strict, tmp_path_factory):
    path = tmp_path_factory.mktemp("rejected") / "dataset.zarr"
    return gather(policy, DatasetWriter(path, GO2), strict, "cpu"), path


def assert_same_rollouts(found, expected, chosen):
    """Some rollouts, bit for bit."""
    for name, values in expected.rows.items():
        np.testing.assert_array_equal(found[name], values[chosen], err_msg=name)
    for name, values in expected.draws.items():
        np.testing.assert_array_equal(found[name], values[chosen], err_msg=name)


def test_batches_go_on_until_enough_are_accepted_which_are_the_first_good_ones(with_rejected, everything, strict):
    result, path = with_rejected
    good = np.flatnonzero(everything.groups["quality"]["joint_rmse"] <= np.float32(strict.max_joint_rmse))
    num_run = 4 * (good[5] // 4 + 1)
    assert 6 < num_run < 24, "more than a batch is needed"
    assert result.accepted == 6
    assert_same_rollouts(zarr.open_group(path / "dog_trot", mode="r"), everything, good[:6])
    assert result.rejected == {"joint_error": int(num_run - np.sum(good < num_run))}


def test_rejected_rollouts_are_kept_with_their_reasons(with_rejected, everything, strict):
    result, path = with_rejected
    tree = xarray.open_datatree(path, engine="zarr")
    rejected = tree["dog_trot/rejected"]
    num_run = 4 * -(-int(np.flatnonzero(np.isin(everything.draws["seed"], rejected["seed"]))[-1] + 1) // 4)
    bad = everything.groups["quality"]["joint_rmse"][:num_run] > np.float32(strict.max_joint_rmse)
    assert rejected.sizes["rejected"] == bad.sum() == sum(result.rejected.values())
    found = {name: rejected[name].values for name in (*everything.rows, *everything.draws)}
    assert_same_rollouts(found, everything, np.flatnonzero(bad))
    meanings = rejected["reason"].attrs["flag_meanings"].split()
    assert Counter(meanings[number] for number in rejected["reason"].values) == result.rejected
    np.testing.assert_array_equal(
        rejected["quality/joint_rmse"].values, everything.groups["quality"]["joint_rmse"][np.flatnonzero(bad)]
    )


def test_a_dataset_with_rejected_rollouts_is_clean(with_rejected):
    report = check_dataset(with_rejected[1], GO2)
    assert report.is_clean, [str(finding) for finding in report.findings]


@pytest.fixture(scope="module")
def leaving(policy, everything, tmp_path_factory):
    """The same rollouts, of which about every second leaves the reference: ended there, and going on until a fall."""
    limit, stores = float(np.median(everything.groups["quality"]["largest_root_error"])), []
    for until_fall in (False, True):
        path = tmp_path_factory.mktemp("leaving") / "dataset.zarr"
        config = replace(
            EVERYTHING, trajectories=6, max_distance=limit, keep_rejected=True, min_acceptance=0.0,
            until_fall=until_fall,
        )  # fmt: skip
        gather(policy, DatasetWriter(path, GO2), config, "cpu")
        stores.append(path)
    return [open_dataset(path, include_rejected=True) for path in stores]


def test_rollouts_that_leave_the_reference_go_on_until_they_fall(leaving):
    plain, whole = ({one.values["seed"]: one for one in data.trajectories()} for data in leaving)
    assert set(plain) == set(whole), "the same rollouts"
    left = [seed for seed, one in plain.items() if one.values["reason"] in ("distance", "rotation")]
    assert left, "some leave it"
    for seed, one in plain.items():
        longer = whole[seed]
        for name, values in one.arrays.items():
            # The reward of the row that ends a rollout is the last that both have.
            np.testing.assert_array_equal(values, longer.arrays[name][: one.length], err_msg=name)
        if seed in left:
            assert longer.length > one.length
            is_fallen = longer.values["reason"] == "body_contact"
            assert longer.values["terminated"] == is_fallen
            assert is_fallen or longer.length == EVERYTHING.rows
            assert longer.values["reason"], "it is no accepted rollout"
        else:
            assert (longer.length, longer.values["reason"]) == (one.length, one.values["reason"])
    assert {whole[seed].values["reason"] for seed in left} & {"distance", "rotation"}


def test_falls_end_rollouts_that_have_left_the_reference_and_are_told_from_those_that_stand(policy, tmp_path):
    drawn = randomized(MILD, push_interval=(0.2, 0.5), push_speed=(0.0, 4.0))
    config = replace(
        EVERYTHING, trajectories=24, num_worlds=24, max_attempts=1.0, rows=60, max_distance=0.8, min_acceptance=0.0,
        until_fall=True, randomization=drawn,
    )  # fmt: skip
    gather(policy, DatasetWriter(tmp_path / "dataset.zarr", GO2), config, "cpu")
    fallen, gone = [], []
    for one in open_dataset(tmp_path / "dataset.zarr", include_rejected=True).trajectories():
        left = np.linalg.norm(one.arrays["root_position"] - one.arrays["reference_root_position"], axis=-1) > 0.8
        has_fallen = one.values["reason"] == "body_contact"
        assert one.values["terminated"] == has_fallen
        assert np.isnan(one.values["final_state/joint_position"]).all() == has_fallen
        assert has_fallen or one.length == config.rows
        assert one.values["reason"] or not left.any(), "none that left is accepted"
        fallen += [one.index] * (has_fallen and bool(left[:-1].any()))
        gone += [one.index] * (not has_fallen and bool(left.any()))
    assert fallen, "some go on after they have left the reference, until they fall"
    assert gone, "some leave it and do not fall"


def test_max_attempts_ends_the_batches_and_what_was_accepted_is_kept(policy, everything, strict, tmp_path):
    second_best = float(np.sort(everything.groups["quality"]["joint_rmse"])[1])
    config = replace(strict, max_joint_rmse=second_best * 1.0001, keep_rejected=False, min_acceptance=0.0)
    result = gather(policy, DatasetWriter(tmp_path / "dataset.zarr", GO2), config, "cpu")
    assert (result.accepted, result.rejected) == (2, {"joint_error": 22})
    assert "rejected" not in zarr.open_group(tmp_path / "dataset.zarr" / "dog_trot", mode="r")
    assert [path.name for path in tmp_path.iterdir()] == ["dataset.zarr"]


def test_too_few_accepted_rollouts_are_refused_and_nothing_is_written(policy, everything, strict, tmp_path):
    second_best = float(np.sort(everything.groups["quality"]["joint_rmse"])[1])
    config = replace(strict, max_joint_rmse=second_best * 1.0001)
    with pytest.raises(DatasetError, match=r"2 of 24 rollouts were accepted, too few \(22 by joint_error\)"):
        gather(policy, DatasetWriter(tmp_path / "dataset.zarr", GO2), config, "cpu")
    assert list(tmp_path.iterdir()) == []


def test_noise_friction_mass_and_start_differ_and_are_stored(everything):
    draws, randomization = everything.draws, everything.groups["randomization"]
    for values in (draws["noise"], draws["heading"], draws["seed"], randomization["friction"],
                   randomization["base_mass"]):  # fmt: skip
        assert len(set(values.tolist())) == 24
    for values, (least, greatest) in (
        (draws["noise"], EVERYTHING.action_noise_scale),
        (randomization["friction"], find_term(EVERYTHING.randomization, "friction").range),
        (randomization["base_mass"], find_term(EVERYTHING.randomization, "base_mass").range),
    ):
        assert least <= values.min() < values.max() <= greatest


def test_more_noise_is_more_scatter_of_the_actions(everything):
    spread = (everything.rows["action"] - everything.rows["action_mean"]).std(axis=(1, 2))
    ratio = spread / everything.draws["noise"]
    assert ratio.std() < 0.15 * ratio.mean()


def test_two_runs_with_one_seed_write_the_same_bits(policy, strict, with_rejected, tmp_path):
    gather(policy, DatasetWriter(tmp_path / "dataset.zarr", GO2), strict, "cpu")
    assert files_of(tmp_path / "dataset.zarr") == files_of(with_rejected[1])


def test_another_seed_gives_other_rollouts(policy, everything, tmp_path):
    config = replace(EVERYTHING, trajectories=4, seed=2)
    gather(policy, DatasetWriter(tmp_path / "dataset.zarr", GO2), config, "cpu")
    other = open_dataset(tmp_path / "dataset.zarr", include_rejected=True).load("dog_trot").trajectories
    assert not set(other.draws["seed"].tolist()) & set(everything.draws["seed"].tolist())
