"""The page holds the figures of the dataset, needs nothing but itself, and trusts no text of the dataset."""

import base64
import io
import json
import re
import shutil
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
import zarr
from PIL import Image

from kine2go_warp.cli.main import main
from kine2go_warp.dataset import open_dataset
from kine2go_warp.errors import RenderError
from kine2go_warp.metrics import FILTER_METRICS
from kine2go_warp.renders import process
from kine2go_warp.reports.report import default_path, write_report
from kine2go_warp.reports.tables import HEADLINES
from kine2go_warp.scores.registry import METRICS
from tests.reports.conftest import Page


@pytest.fixture(scope="module")
def scores(walks, tmp_path_factory):
    """What ``kine2go dataset score --json`` says of the dataset."""
    path = tmp_path_factory.mktemp("scores") / "scores.json"
    assert main(["score", str(walks), "--json", str(path)]) == 0
    return json.loads(path.read_text())


def values_of(row):
    """Figures of a row by name; a cell without a value has none."""
    return {
        cell.attributes["data-name"]: float(cell.attributes["data-value"]) if "data-value" in cell.attributes else None
        for cell in row
        if "data-name" in cell.attributes
    }


def test_the_scorecard_holds_what_score_writes(page, scores):
    heading, stroll, walk, total = page.tables["Scorecard"]
    assert len(heading) == 3 + len(HEADLINES)
    rows = {"stroll": stroll, "walk": walk}
    for name, row in rows.items():
        assert row[0].text == name
        values = values_of(row)
        assert values["trajectories"] == scores["motions"][name]["trajectories"] == 3
        assert values["duration"] == pytest.approx(scores["motions"][name]["rows"] / 60.0)
        for figure in HEADLINES:
            assert values[figure] == pytest.approx(scores["motions"][name]["scores"][figure]["value"], rel=1e-12)
    assert total[0].text == "all motions"
    overall = values_of(total)
    for figure in HEADLINES:
        assert overall[figure] == pytest.approx(scores["overall"][figure]["value"], rel=1e-12)


def test_each_motion_has_all_metrics(page, scores):
    for name in ("walk", "stroll"):
        _, *rows = page.tables[f"All metrics of {name}"]
        assert [row[0].text for row in rows] == [metric.name for metric in METRICS]
        for row in rows:
            for figure, value in values_of(row).items():
                assert value == pytest.approx(scores["motions"][name]["scores"][figure]["value"], rel=1e-12)


def test_the_reference_of_a_motion_has_its_figures_where_the_dataset_says_them(page):
    heading, *rows = page.tables["Reference of walk"]
    assert [cell.text for cell in heading] == ["metric", "value", "unit", "meaning"]
    assert [[cell.text for cell in row] for row in rows] == [
        ["trunk_pitch", "-0.556", "deg", "pitch & <more>"],
        ["flight_acceleration", "-", "m/s^2", "while no foot stands"],
    ]
    assert values_of(rows[0]) == {"trunk_pitch": -0.55641}
    assert "Reference of stroll" not in page.tables
    assert not any("fidelity" in row[0].text for row in page.tables["Settings"])


def test_rejections_licences_and_settings_are_those_of_the_dataset(page):
    heading, stroll, walk = page.tables["Rejections"]
    assert [cell.text for cell in heading] == ["motion", "rollouts", "accepted", "share accepted", "distance"]
    assert [cell.text for cell in stroll] == ["stroll", "3", "3", "1", "0"]
    assert [cell.text for cell in walk] == ["walk", "5", "3", "0.6", "2"]
    _, stroll, walk = page.tables["Licences"]
    assert [cell.text for cell in stroll] == ["stroll", "made up", "unknown", "CC BY-SA 4.0", "Two & <b>Three</b>"]
    assert [cell.text for cell in walk][3:] == ["CC BY-NC 4.0", "One, 2018"]


def test_nothing_comes_from_elsewhere(page, report):
    for _, attributes in page.elements:
        for name in ("src", "href", "xlink:href", "srcset", "action", "data"):
            assert attributes.get(name, "#").startswith(("#", "data:")), attributes
    assert "http://" not in report.read_text()
    assert "https://" not in report.read_text()
    assert "@import" not in report.read_text()
    policy = next(one["content"] for one in page.all("meta") if one.get("http-equiv") == "Content-Security-Policy")
    assert policy.startswith("default-src 'none'")


def test_elements_are_closed_and_names_lead_somewhere_and_are_unique(page):
    assert page.open_elements == []
    names = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(names) == len(set(names))
    for _, attributes in page.elements:
        if attributes.get("href", "").startswith("#"):
            assert attributes["href"][1:] in names
        for name in re.findall(r"url\(#([^)]*)\)", " ".join(str(value) for value in attributes.values())):
            assert name in names


@pytest.mark.usefixtures("can_draw")
def test_pictures_of_the_best_median_and_worst_trajectory_are_there(page):
    images = page.all("img")
    assert len(images) == 2 * 3 * 3
    for image in images:
        with Image.open(io.BytesIO(base64.b64decode(image["src"].split(",")[1]))) as picture:
            assert (picture.format, picture.size) == ("JPEG", (320, 240))
        assert image["alt"]
    assert len({image["src"] for image in images}) == len(images)
    shown = [re.search(r"trajectory (\d)", image["alt"]).group(1) for image in images[9::3]]
    assert shown == ["1", "0", "2"], "references are off by 0.01, 0.02 and 0.03 rad"


def test_plots_take_the_colours_of_the_page(page, report):
    plots = [one["aria-label"].split(" of ")[0] for one in page.all("svg")]
    assert plots == ["Root paths", "Errors and leg distance"] * 2
    assert report.read_text().count("currentColor") > 20
    for style in (attributes.get("style", "") for _, attributes in page.elements):
        assert not re.search(r"(fill|stroke): #(000000|ffffff|010203)", style)


def test_a_page_is_small_and_the_same_each_time(walks, report, tmp_path):
    again = tmp_path / "again.html"
    write_report(walks, again)
    assert again.read_bytes() == report.read_bytes()
    assert report.stat().st_size < 3e6 / 8 * 2


def test_texts_of_a_dataset_cannot_become_part_of_the_page(walks, tmp_path):
    copy = shutil.copytree(walks, tmp_path / "spoilt.zarr")
    evil = '</script><script>alert("1")</script><img src=x onerror=alert(2)>'
    attributes = zarr.open_group(copy / "walk", mode="a", use_consolidated=False).attrs
    attributes.update({"licence": evil, "device": evil, "rejected": {evil: 1}})
    write_report(copy, tmp_path / "page.html", pictures=False)
    page = Page((tmp_path / "page.html").read_text())
    assert len(page.all("script")) == 1
    assert page.all("img") == []
    assert page.tables["Licences"][2][3].text == evil
    assert page.tables["Rejections"][0][-1].text == evil


def test_without_a_library_to_draw_with_the_page_says_so(walks, tmp_path, monkeypatch):
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(process.ctypes.util, "find_library", lambda _: None)
    parts = write_report(walks, tmp_path / "page.html", motions=["walk"])
    html = (tmp_path / "page.html").read_text()
    assert "No pictures: no OpenGL library" in html
    assert "libegl1" in parts[0].note
    assert Page(html).all("img") == []
    assert len(Page(html).all("svg")) == 2


def test_a_failed_report_leaves_nothing(walks, tmp_path):
    copy = shutil.copytree(walks, tmp_path / "spoilt.zarr")
    next(path for path in (copy / "walk" / "joint_torque" / "c").rglob("*") if path.is_file()).write_bytes(b"damaged")
    with pytest.raises(Exception, match="walk/joint_torque: cannot be read"):
        write_report(copy, tmp_path / "page.html")
    zarr.open_group(copy / "stroll", mode="a", use_consolidated=False)["length"][:] = [30, 0, 30]
    with pytest.raises(RenderError, match="an empty one"):
        write_report(copy, tmp_path / "page.html", motions=["stroll"])
    assert [one.name for one in tmp_path.iterdir()] == ["spoilt.zarr"]


def test_the_page_goes_beside_the_dataset(tmp_path):
    assert default_path(tmp_path / "dataset.zarr") == tmp_path / "dataset_report.html"


def test_the_figures_are_those_of_the_rows(page, walks):
    """Joint errors were put in by hand: 0.02, 0.01 and 0.03 rad, but for the short trajectory all over the rows."""
    assert open_dataset(walks, include_rejected=True).load("walk").trajectories.draws["length"].tolist() == [60, 55, 60]
    row = next(row for row in page.tables["Scorecard"] if row[0].text == "walk")
    assert values_of(row)["joint_rmse"] == pytest.approx(0.02, rel=1e-4)


def test_the_page_says_how_close_each_motion_came_to_the_limits(walks, tmp_path):
    copy = Path(shutil.copytree(walks, tmp_path / "walks.zarr"))
    stored = open_dataset(copy, include_rejected=True).load("walk").trajectories.groups["quality"]
    largest = {name: float(np.nanmax(values)) for name, values in stored.items()}
    limits = {limit.setting: 9.0 for limit in FILTER_METRICS}
    limits |= {"max_joint_rmse": largest["joint_rmse"] / 0.9, "max_distance": largest["largest_root_error"] / 0.6}
    attributes = zarr.open_group(copy / "walk", mode="a", use_consolidated=False).attrs
    attributes.update({"gather_settings": json.dumps(limits)})
    write_report(copy, tmp_path / "page.html", pictures=False)
    page = Page((tmp_path / "page.html").read_text())
    rows = {row[0].text: row for row in page.tables["Limits of walk"][1:]}
    assert rows["joint RMSE"][5].text.strip() == "90%"
    assert [rows[name][6].text for name in ("joint RMSE", "root distance")] == ["close", "fair"]
    assert float(rows["joint RMSE"][2].attributes["data-value"]) == pytest.approx(largest["joint_rmse"])
    (card,) = [one for one in page.all("li") if one.get("data-motion") == "walk"]
    assert card["data-mark"] == "close"
    assert page.tables["Limits of walk"][1][0].text == "joint RMSE"


def test_the_page_says_when_and_where_the_data_were_made(walks, report):
    changed = datetime.fromtimestamp((walks / "zarr.json").stat().st_mtime, UTC)
    assert f"Data of {changed:%Y-%m-%d %H:%M} UTC, at {walks}" in report.read_text()
