"""Everything that reads a dataset leaves out what a review rejected, and refuses data that are missing."""

import json
import re
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import zarr

from examples import behaviour_cloning
from kine2go_warp.cli.main import main
from kine2go_warp.cli.review_steps import by_limit_usage
from kine2go_warp.dataset import compute_statistics, load_rows, open_dataset
from kine2go_warp.dataset.motion import Motion
from kine2go_warp.dataset.reviews import FILE
from kine2go_warp.dataset.schema import ROW_ARRAYS, SUB_GROUPS, TRAJECTORY_ARRAYS
from kine2go_warp.dataset.summary import summarise
from kine2go_warp.dataset.torch_windows import WindowDataset
from kine2go_warp.errors import DatasetError
from tests.conftest import ANYTHING_GOES
from tests.reports.conftest import Page

REMAINING = (0, 2)
"""Trajectories of ``walk`` that remain; 1 is rejected, whose joints are off by 0.01 rad where theirs are by 0.02 and
0.03 rad."""
JOINT_RMSE = 0.025


@pytest.fixture
def dataset(walks: Path, tmp_path: Path) -> Path:
    """The walks, filtered by limits that everything keeps."""
    path = Path(shutil.copytree(walks, tmp_path / "walks.zarr"))
    for motion in ("walk", "stroll"):
        zarr.open_group(path / motion, mode="a", use_consolidated=False).attrs.update(
            {"gather_settings": ANYTHING_GOES}
        )
    return path


@pytest.fixture
def reviewed(dataset: Path) -> Path:
    """Those walks after a review that rejected trajectory 1 of ``walk``."""
    assert main(["review", str(dataset), "--reject", "walk/1", "--why", "limps"]) == 0
    return dataset


def test_loaders_and_windows_leave_it_out(reviewed):
    data = open_dataset(reviewed)
    assert [one.index for one in data.references if one.motion == "walk"] == list(REMAINING)
    assert load_rows(data.select(["walk"])).table.shape[0] == 120
    assert [one.index for one in data.trajectories(["walk"])] == list(REMAINING)
    assert {one.index for one in data.windows(10, 10, ["walk"])} == set(REMAINING)
    assert data.load("walk").indices.tolist() == list(REMAINING)
    assert len(WindowDataset(load_rows(data.select(["walk"])), 60)) == 2


def test_asked_for_it_is_read(reviewed):
    whole = open_dataset(reviewed, include_rejected=True)
    assert [one.index for one in whole.references if one.motion == "walk"] == [0, 1, 2]
    assert whole.load("walk").indices.tolist() == [0, 1, 2]


def test_statistics_are_of_the_remaining_rows(reviewed):
    rows = open_dataset(reviewed, include_rejected=True).load("walk").trajectories.rows["action"][list(REMAINING)]
    statistics = compute_statistics(open_dataset(reviewed).select(["walk"]), ["action"])["action"]
    assert statistics.count.tolist() == [120] * 12
    np.testing.assert_allclose(statistics.mean, rows.astype(np.float64).mean(axis=(0, 1)), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("form", ["npz", "lerobot"])
def test_exports_hold_the_others(reviewed, tmp_path, form):
    assert main(["export", str(reviewed), "--format", form, "--out", str(tmp_path / "out")]) == 0
    assert json.loads((tmp_path / "out" / "export.json").read_text())["trajectories"] == 5
    if form == "npz":
        names = {file.name for file in (tmp_path / "out" / "cc-by-nc-4.0" / "walk").iterdir()}
        assert names == {"trajectory-0000.npz", "trajectory-0002.npz"}
    else:
        for licence, count in (("cc-by-nc-4.0", 2), ("cc-by-sa-4.0", 3)):
            info = json.loads((tmp_path / "out" / licence / "meta" / "info.json").read_text())
            assert info["total_episodes"] == count


def test_score_report_quality_and_summary_agree(reviewed, tmp_path, capsys):
    assert main(["score", str(reviewed), "--json", str(tmp_path / "scores.json")]) == 0
    assert "left out 1 of 6 trajectories, rejected in a review" in capsys.readouterr().out
    walk = json.loads((tmp_path / "scores.json").read_text())["motions"]["walk"]
    assert walk["trajectories"] == 2
    assert walk["scores"]["joint_rmse"]["value"] == pytest.approx(JOINT_RMSE, rel=1e-4)

    assert main(["report", str(reviewed), "--no-pictures", "--out", str(tmp_path / "page.html")]) == 0
    assert "5 trajectories of 2 motions" in capsys.readouterr().out
    html = (tmp_path / "page.html").read_text()
    assert "left out 1 of 6 trajectories, rejected in a review" in html
    row = next(row for row in Page(html).tables["Scorecard"] if row[0].text == "walk")
    shown = {cell.attributes["data-name"]: float(cell.attributes["data-value"]) for cell in row
             if "data-value" in cell.attributes and "data-name" in cell.attributes}  # fmt: skip
    assert shown["trajectories"] == 2
    for name, value in shown.items():
        if name in walk["scores"]:
            assert value == pytest.approx(walk["scores"][name]["value"], rel=1e-12)

    assert main(["quality", str(reviewed)]) == 0
    output = capsys.readouterr().out
    assert "walk: 2 accepted rollouts" in output
    assert "coverage: not measured" in output  # the phase of these generated rows stands still
    assert "left out 1 of 6 trajectories, rejected in a review" in output

    summary = next(one for one in summarise(reviewed) if one.motion == "walk")
    assert (summary.accepted, summary.rejected_in_review) == (3, 1)
    assert summary.joint_rmse == pytest.approx(JOINT_RMSE, rel=1e-4)


@pytest.mark.usefixtures("can_draw")
def test_pictures_of_the_page_are_of_the_others(reviewed, tmp_path):
    assert main(["report", str(reviewed), "walk", "--out", str(tmp_path / "page.html")]) == 0
    images = Page((tmp_path / "page.html").read_text()).all("img")
    assert {re.search(r"trajectory (\d)", one["alt"]).group(1) for one in images} == {"0", "2"}


def test_a_motion_without_remaining_trajectories_is_left_out(reviewed, tmp_path, capsys):
    assert main(["review", str(reviewed), "--reject", "walk", "--why", "limps"]) == 0
    for command in (["score"], ["report", "--no-pictures", "--out", str(tmp_path / "a.html")], ["quality"]):
        assert main([command[0], str(reviewed), *command[1:]]) == 0
        assert main([command[0], str(reviewed), "walk", *command[1:]]) == 2
        assert "all trajectories were rejected in a review" in capsys.readouterr().err
    assert np.isnan(next(one for one in summarise(reviewed) if one.motion == "walk").joint_rmse)


def test_check_looks_at_what_is_stored_whatever_a_review_said(reviewed, capsys):
    main(["check", str(reviewed), "--json"])
    before = json.loads(capsys.readouterr().out)
    assert {"check": "reviews", "motion": None, "state": "ok"}.items() <= next(
        one for one in before["results"] if one["check"] == "reviews"
    ).items()
    stored = zarr.open_group(reviewed / "walk", mode="a", use_consolidated=False)["joint_torque"]
    stored[1, 7, 3] = np.inf
    main(["check", str(reviewed), "--json"])
    after = json.loads(capsys.readouterr().out)
    found = [one for one in after["findings"] if one not in before["findings"]]
    assert any(one["trajectory"] == 1 and one["array"] == "joint_torque" for one in found)


def test_a_review_does_not_ask_again(reviewed):
    motion = Motion(reviewed, "walk")
    assert {one.reference.index for one in by_limit_usage([motion], again=False)} == set(REMAINING)
    assert {one.reference.index for one in by_limit_usage([motion], again=True)} == {0, 1, 2}


class Policy:
    """A policy that the walks could have been gathered from."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def read_record(self) -> None: ...

    def read_clips(self, record: None) -> list[SimpleNamespace]:
        return [SimpleNamespace(name="walk", record=record)]

    def checkpoint_hash(self) -> str:
        return "0123"


def test_the_example_learns_from_the_others(reviewed, tmp_path, monkeypatch):
    zarr.open_group(reviewed / "walk", mode="a", use_consolidated=False).attrs.update({"policy_sha256": "0123"})
    seen = []

    def train(training, validation, settings):
        seen.extend((*training.references, *validation.references))
        raise DatasetError(f"{settings.dataset}: enough was seen")

    monkeypatch.setattr(behaviour_cloning, "PolicyFolder", Policy)
    monkeypatch.setattr(behaviour_cloning, "environment_config", lambda *_: None)
    monkeypatch.setattr(behaviour_cloning, "train", train)
    with pytest.raises(DatasetError, match="enough was seen"):
        behaviour_cloning.run(behaviour_cloning.Settings(reviewed, tmp_path, validation=0.5))
    assert sorted(one.index for one in seen) == list(REMAINING)


COMMANDS = {
    "loader": lambda path: load_rows(open_dataset(path)),
    "statistics": lambda path: compute_statistics(open_dataset(path)),
    "export": ("export", "--format", "npz"),
    "export to LeRobot": ("export", "--format", "lerobot"),
    "score": ("score",),
    "quality": ("quality",),
    "report": ("report", "--no-pictures"),
    "review": ("review", "--save", "walk"),
}
"""What reads a dataset: a function, or a command with its options; the path of the output goes last."""


def refusal(name: str, path: Path, out: Path, capsys) -> str:
    """Read a dataset with one of ``COMMANDS``, which must refuse it and leave nothing, and return the message."""
    command = COMMANDS[name]
    if callable(command):
        with pytest.raises(DatasetError) as caught:
            command(path)
        return str(caught.value)
    capsys.readouterr()
    output = {"export": ["--out", str(out)], "report": ["--out", str(out.with_suffix(".html"))]}
    output["review"] = output["export"]
    assert main([command[0], str(path), *command[1:], *output.get(command[0], [])]) == 2
    assert not out.exists() or not list(out.iterdir())
    assert not out.with_suffix(".html").exists()
    error = capsys.readouterr().err.strip()
    assert len(error.splitlines()) == 1
    return error


@pytest.mark.parametrize("name", COMMANDS)
def test_a_damaged_file_of_reviews_is_an_error_everywhere(dataset, tmp_path, capsys, name):
    (dataset / FILE).write_text("{")
    assert FILE in refusal(name, dataset, tmp_path / "out", capsys)


def test_check_finds_a_damaged_file_of_reviews(dataset, capsys):
    (dataset / FILE).write_text("{")
    assert main(["check", str(dataset)]) == 1
    assert "not a file of verdicts" in capsys.readouterr().out


def drop_array(dataset: Path, name: str) -> None:
    shutil.rmtree(dataset / "walk" / name)


def drop_chunk(dataset: Path, name: str) -> None:
    (chunk,) = (path for path in (dataset / "walk" / name / "c").rglob("*") if path.is_file())
    chunk.unlink()


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("damage", [drop_array, drop_chunk])
def test_missing_data_are_refused_with_one_line(dataset, tmp_path, capsys, name, damage):
    damage(dataset, "joint_position")
    assert "walk/joint_position: data are missing" in refusal(name, dataset, tmp_path / "out", capsys)


def test_an_array_that_also_the_index_lacks_is_missed(dataset):
    drop_array(dataset, "joint_position")
    for folder in (dataset, dataset / "walk"):
        metadata = json.loads((folder / "zarr.json").read_text())
        metadata.pop("consolidated_metadata", None)
        (folder / "zarr.json").write_text(json.dumps(metadata))
    with pytest.raises(DatasetError, match="joint_position: data are missing"):
        list(open_dataset(dataset).trajectories(["walk"]))


def test_no_array_is_read_as_its_fill_value(dataset):
    """Of whole numbers only the lengths: 0 is a seed and a delay like any other."""
    schema = {"": (*ROW_ARRAYS, *TRAJECTORY_ARRAYS), **SUB_GROUPS}
    names = [f"{group}/{array.name}".lstrip("/") for group, arrays in schema.items() for array in arrays
             if array.dtype == "float32" or array.name == "length"]  # fmt: skip
    assert len(names) > 45
    for name in ("time", *names):
        (chunk,) = (path for path in (dataset / "walk" / name / "c").rglob("*") if path.is_file())
        hidden = chunk.rename(dataset / "hidden")
        with pytest.raises(DatasetError, match=f"walk/{name}: data are missing"):
            open_dataset(dataset).load("walk")
        hidden.rename(chunk)
    assert len(open_dataset(dataset).load("walk").indices) == 3


def test_labels_that_are_missing_are_refused(dataset):
    drop_chunk(dataset, "joint")
    with pytest.raises(DatasetError, match="walk/joint: data are missing"):
        Motion(dataset, "walk").labels("joint")
