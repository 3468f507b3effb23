"""What stands in the cells."""

import math

import numpy as np
import pytest

from kine2go_warp.reports import tables
from kine2go_warp.reports.thumbnails import ranked_trajectories


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0123456, "0.0123"), (4560.4, "4,560"), (math.nan, "-"), (0.0, "0"), (20.0, "20"), (2.92e-5, "2.92e-05")],
)
def test_numbers_have_three_digits(value, text):
    assert tables.number_text(value) == text


def test_what_is_not_a_number_is_sorted_last():
    assert tables.number(math.nan).value is None
    assert not tables.number(math.nan).is_number


def test_settings_are_split_into_shared_and_different():
    one = {"motion": "a", "device": "cpu", "gather_settings": {"seed": 1, "warm_up": 0.5, "rows": [1, 2]}}
    other = {"motion": "b", "device": "cpu", "gather_settings": {"seed": 2, "warm_up": 0.5}, "extra": True}
    shared, different = tables.settings({"a": one, "b": other})
    assert {row[0].text: row[1].text for row in shared.rows} == {
        "device": "cpu",
        "gather_settings.warm_up": "0.5",
    }
    assert {row[0].text: [cell.text for cell in row[1:]] for row in different.rows} == {
        "extra": ["-", "True"],
        "gather_settings.rows": ["1, 2", "-"],
        "gather_settings.seed": ["1", "2"],
    }
    assert [column.text for column in different.columns] == ["setting", "a", "b"]


def test_hashes_are_shortened_and_other_texts_are_not():
    digest = "0123456789abcdef" * 4
    cell = tables.setting(digest)
    assert (cell.text, cell.hint) == ("0123456789ab...", digest)
    assert tables.setting(digest[:40] + "+").text == "0123456789ab...+"
    assert tables.setting("bec1f793c61b2a56") == tables.Cell("bec1f793c61b2a56")


def test_rejections_of_motions_with_other_reasons_share_a_table():
    content = tables.rejections({"a": {"rejected": {"fall": 2}, "accepted": 6}, "b": {}}, {"a": 6, "b": 4})
    assert [column.text for column in content.columns] == ["motion", "rollouts", "accepted", "share accepted", "fall"]
    assert [[cell.text for cell in row] for row in content.rows] == [
        ["a", "8", "6", "0.75", "2"],
        ["b", "4", "4", "1", "0"],
    ]


def test_facts_have_units_and_absent_ones_are_left_out():
    assert tables.facts({"damping": 2.0}, {"damping": "N m s/rad", "robot": ""}) == [
        ("damping", tables.Cell("2 N m s/rad"))
    ]


def test_best_median_and_worst_are_ranked_and_each_is_shown_once():
    assert ranked_trajectories(np.array([0.3, 0.1, np.nan, 0.2])) == {"best": 1, "median": 3, "worst": 0}
    assert ranked_trajectories(np.array([0.2, 0.1])) == {"best": 1, "worst": 0}
    assert ranked_trajectories(np.array([0.2])) == {"best": 0}
    assert ranked_trajectories(np.array([np.nan])) == {}
