"""The worked example of docs/adding-a-source.md, followed as it stands there."""

import json
import re

import numpy as np
import pytest

from kine2go_warp.cli.main import main
from kine2go_warp.errors import ClipError
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.motions.generator import DogGait, generate
from kine2go_warp.motions.keypoints import KEYPOINTS
from kine2go_warp.motions.sources import source_named
from kine2go_warp.motions.sources.ai4animation import COLUMN_OF_KEYPOINT
from kine2go_warp.pipelines.job import Job
from kine2go_warp.pipelines.recipe import check_recipe
from kine2go_warp.pipelines.workspace import Workspace
from tests.conftest import REPOSITORY

PAGE = (REPOSITORY / "docs" / "adding-a-source.md").read_text()


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder with the files of the page and a cat."""
    for name, kind in (("my_source.py", "python"), ("my_cats.toml", "toml")):
        (text,) = re.findall(rf"```{kind}\n(.*?)```", PAGE, re.DOTALL)
        (tmp_path / name).write_text(text)
    (tmp_path / "cats").mkdir()
    write_cat(tmp_path / "cats" / "walk.npz")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write_cat(path):
    """The generated dog at half its size, in centimetres and y up."""
    points = 0.5 * generate(DogGait(), 121).points
    x, y, z = np.moveaxis(points, -1, 0)
    y_up = 100.0 * np.stack([x, z, -y], axis=-1)
    np.savez(path, rate=60.0, **{name: y_up[:, COLUMN_OF_KEYPOINT[name]] for name in KEYPOINTS})


def test_the_commands_of_the_page_make_a_clean_clip(place, capsys):
    (commands,) = re.findall(r"```bash\n(.*?)```", PAGE, re.DOTALL)
    for command in commands.strip().splitlines():
        assert main(command.split()[1:]) == 0, capsys.readouterr().err
    report = json.loads((place / "clips" / "report.json").read_text())
    assert [(one["name"], one["remarks"]) for one in report] == [("cat_walk", [])]
    clip = MotionClip.load(place / "clips" / "cat_walk.npz")
    assert clip.origin.source == "my_source.py:CatCapture"
    assert clip.origin.licence == "CC BY 4.0"


def test_a_recipe_takes_the_catalogue_of_the_page(place):
    values = {"name": "cats", "motions": ["cat_walk", "dog_trot"], "catalogue": "my_cats.toml"}
    recipe = check_recipe(values, "cats.toml")
    entries = [Job(name, recipe, Workspace(place / "run"), place, "cpu").entry for name in recipe.motions]
    assert [entry.source for entry in entries] == ["my_source.py:CatCapture", "ai4animation"]


def test_the_example_refuses_what_is_not_a_cat(place):
    (place / "dog.npz").write_text("woof")
    with pytest.raises(ClipError, match="not a cat"):
        source_named("my_source.py:CatCapture").read(place / "dog.npz")


@pytest.mark.parametrize(
    ("catalogue", "expected"),
    [("my_source.py:np", "is no subclass"), ("gone.py:A", "no such Python file"), ("my_source.py:B", "defines no 'B'")],
)
def test_what_is_no_source_is_one_line(place, catalogue, expected, capsys):
    file = place / "my_cats.toml"
    file.write_text(file.read_text().replace("my_source.py:CatCapture", catalogue))
    assert main(["retarget", "cat_walk", "--catalogue", "my_cats.toml", "--data", ".", "--out", "clips"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert expected in line
    assert not (place / "clips").exists()
