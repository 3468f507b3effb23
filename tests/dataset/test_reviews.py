"""Reviews: who said what of which rows, kept beside the motions."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import xarray

from kine2go_warp.dataset import load_rows, open_dataset
from kine2go_warp.dataset.checks.run import check_dataset
from kine2go_warp.dataset.motion import Motion
from kine2go_warp.dataset.reviews import (
    ACCEPTED,
    FILE,
    LOCK,
    REJECTED,
    add_reviews,
    content_hash,
    new_review,
    read_reviews,
    remove_review,
    standing_reviews,
)
from kine2go_warp.dataset.store import motion_names
from kine2go_warp.dataset.trajectories import Trajectories
from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.errors import DatasetError
from kine2go_warp.exports.export import export_dataset
from kine2go_warp.robots import GO2
from tests.dataset.test_store import SIMULATION, made_up


@pytest.fixture
def path(tmp_path, rng):
    """Two motions of three trajectories."""
    writer = DatasetWriter(tmp_path / "dataset.zarr", GO2)
    for name in ("one", "two"):
        writer.write(name, made_up(rng), SIMULATION, {"rejected": {}, "accepted": 3, "licence": "CC0"})
    return tmp_path / "dataset.zarr"


def say(path, motion, index, verdict, why="", who="Ada"):
    """Give a verdict on one trajectory."""
    opened = Motion(path, motion)
    (one,) = opened.read([opened.references()[index]], None)
    given = new_review(one, verdict, why, who)
    add_reviews(path, [given])
    return given


def places(path, motion):
    """Which trajectories stand accepted or rejected."""
    return {index: one.verdict for index, one in standing_reviews(Motion(path, motion)).items()}


def rewrite(path, motion, trajectories):
    DatasetWriter(path, GO2).write(motion, trajectories, SIMULATION, {"rejected": {}, "licence": "CC0"})


def test_a_verdict_keeps_who_when_and_why(path):
    given = say(path, "one", 1, REJECTED, "drags a leg", "Grace")
    assert read_reviews(path) == (given,)
    assert (given.reviewer, given.reason, given.index) == ("Grace", "drags a leg", 1)
    assert given.when.endswith("+00:00")


def test_the_last_verdict_counts_and_can_be_taken_back(path):
    say(path, "one", 1, REJECTED, "looked wrong")
    last = say(path, "one", 1, ACCEPTED)
    assert places(path, "one") == {1: ACCEPTED}
    remove_review(path, last)
    assert places(path, "one") == {1: REJECTED}
    assert places(path, "two") == {}
    remove_review(path, last)
    assert len(read_reviews(path)) == 1


def test_a_verdict_survives_gathering_the_same_again(path):
    say(path, "one", 1, REJECTED, "drags a leg")
    rewrite(path, "one", open_dataset(path, include_rejected=True).load("one").trajectories)
    assert places(path, "one") == {1: REJECTED}


def test_a_verdict_follows_its_rows_to_another_place(path):
    say(path, "one", 2, REJECTED, "drags a leg")
    data = open_dataset(path, include_rejected=True).load("one").trajectories
    rewrite(path, "one", data.selected(np.array([False, True, True])))
    assert places(path, "one") == {1: REJECTED}


@pytest.mark.parametrize("array", ["root_position", "action", "reward"])
def test_a_verdict_lapses_when_any_row_changes(path, array):
    say(path, "one", 1, REJECTED, "drags a leg")
    say(path, "one", 2, REJECTED, "falls")
    data = open_dataset(path, include_rejected=True).load("one").trajectories
    rows = {name: values.copy() for name, values in data.rows.items()}
    rows[array][1, 7] += 1e-3
    rewrite(path, "one", Trajectories(rows, data.draws, data.groups))
    assert places(path, "one") == {2: REJECTED}
    assert len(read_reviews(path)) == 2, "the record is kept"


def test_padding_is_no_content(path):
    motion = Motion(path, "one")
    (one,) = motion.read(motion.references()[1:2], None)
    assert one.arrays["action"].shape[0] == 15
    shorter = replace(one, arrays={name: values[:14] for name, values in one.arrays.items()})
    assert content_hash(shorter) != content_hash(one)


def test_loading_export_and_statistics_leave_rejected_trajectories_out(path, tmp_path):
    whole = load_rows(open_dataset(path)).references
    say(path, "one", 0, REJECTED, "falls")
    say(path, "one", 1, ACCEPTED)
    say(path, "two", 2, REJECTED, "limps")
    used = [(one.motion, one.index) for one in open_dataset(path).references]
    assert len(whole) == 6
    assert used == [("one", 1), ("one", 2), ("two", 0), ("two", 1)]
    assert open_dataset(path).load("one").indices.tolist() == [1, 2]
    assert export_dataset(path, "npz", tmp_path / "npz").trajectories == 4
    data, left_out = open_dataset(path).load("two"), open_dataset(path).left_out("two")
    assert (data.trajectories.num_trajectories, left_out) == (2, {2})
    stored = open_dataset(path, include_rejected=True).load("two").trajectories.rows["action"][:2]
    assert np.array_equal(data.trajectories.rows["action"], stored, equal_nan=True)


def test_split_stays_as_it_was_for_the_others(path):
    train, validation = open_dataset(path).split(0.4, seed=3)
    say(path, "one", 0, REJECTED, "falls")
    train_after, validation_after = open_dataset(path).split(0.4, seed=3)
    rejected = {("one", 0)}
    for before, after in ((train, train_after), (validation, validation_after)):
        expected = {(one.motion, one.index) for one in before.references} - rejected
        assert {(one.motion, one.index) for one in after.references} == expected


def test_the_store_is_as_readable_as_before(clean_dataset, dataset_copy):
    say(dataset_copy, "dog_trot", 0, REJECTED, "falls")
    assert {path.name for path in dataset_copy.iterdir()} >= {FILE, LOCK}
    tree = xarray.open_datatree(dataset_copy, engine="zarr")
    assert set(tree.children) == {"dog_trot"}
    assert xarray.open_zarr(dataset_copy, group="dog_trot").sizes["trajectory"] == 5
    assert motion_names(dataset_copy) == ["dog_trot"]
    before, after = check_dataset(clean_dataset, GO2), check_dataset(dataset_copy, GO2)
    assert [result.state for result in after.results] == [result.state for result in before.results]
    assert [str(one) for one in after.findings] == [str(one) for one in before.findings]


def test_adding_and_replacing_motions_keeps_the_verdicts(path, rng):
    given = say(path, "one", 0, REJECTED, "falls")
    rewrite(path, "two", made_up(rng))
    rewrite(path, "three", made_up(rng))
    assert read_reviews(path) == (given,)
    assert places(path, "one") == {0: REJECTED}


WRITER = """
import sys
from dataclasses import replace
from pathlib import Path
from kine2go_warp.dataset.motion import Motion
from kine2go_warp.dataset.reviews import REJECTED, add_reviews, new_review
path, who = Path(sys.argv[1]), sys.argv[2]
motion = Motion(path, "one")
(one,) = motion.read(motion.references()[:1], None)
sys.stdin.readline()
for number in range(50):
    add_reviews(path, [new_review(one, REJECTED, str(number), who)])
"""


def test_two_reviewers_at_once_never_lose_a_verdict(path):
    command = [sys.executable, "-c", WRITER, str(path)]
    names = ("Ada", "Grace")
    writers = [subprocess.Popen([*command, name], stdin=subprocess.PIPE, text=True) for name in names]
    for writer in writers:
        writer.stdin.write("go\n")
        writer.stdin.flush()
    assert [writer.wait(60) for writer in writers] == [0, 0]
    verdicts = read_reviews(path)
    for name in names:
        assert [one.reason for one in verdicts if one.reviewer == name] == [str(number) for number in range(50)]
    assert {file.name for file in path.iterdir()} == {"zarr.json", "one", "two", FILE, LOCK}


BROKEN = {
    "no JSON": "{",
    "another format": json.dumps({"format_version": 7, "verdicts": []}),
    "a list": "[]",
    "no verdicts": json.dumps({"format_version": 1}),
    "verdicts are no list": json.dumps({"format_version": 1, "verdicts": 3}),
    "a verdict without a motion": json.dumps({"format_version": 1, "verdicts": [{"index": 1}]}),
    "an unknown verdict": json.dumps(
        {
            "format_version": 1,
            "verdicts": [
                {"motion": "one", "index": 0, "content": "", "verdict": "maybe", "why": "", "who": "", "when": ""}
            ],
        }
    ),
}


@pytest.mark.parametrize("fault", BROKEN)
def test_a_damaged_file_is_never_taken_for_no_verdicts(path, fault):
    (path / FILE).write_text(BROKEN[fault])
    with pytest.raises(DatasetError, match="mend or remove it"):
        open_dataset(path).load("one")
    with pytest.raises(DatasetError, match="mend or remove it"):
        say(path, "one", 0, ACCEPTED)
    assert (path / FILE).read_text() == BROKEN[fault]
