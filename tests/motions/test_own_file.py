"""From a file that no catalogue names to a table, a clip and a recipe."""

import numpy as np
import pytest

from kine2go_warp.cli.main import main
from kine2go_warp.errors import CatalogueError, ClipError, RecipeError
from kine2go_warp.motions.catalogue import load_catalogue
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.motions.generator import DogGait, generate
from kine2go_warp.motions.own_file import OwnFile, introduce
from kine2go_warp.pipelines.job import Job
from kine2go_warp.pipelines.recipe import load_recipe
from kine2go_warp.pipelines.workspace import Workspace
from kine2go_warp.robots import GO2
from tests.motions.sources.files import AI4ANIMATION, AI4ANIMATION_PARENTS, dog, write_amp, write_bvh, write_pickle

NAMES = {name: name.replace("Left", "dog:L_").replace("Right", "dog:R_") for name in AI4ANIMATION}

TABLE_NAMES = (
    "pelvis",
    "withers",
    *(f"{part}_{side}" for part in ("shoulder", "thigh", "frontpaw", "hindpaw") for side in "lr"),
)


@pytest.fixture
def hound(tmp_path, monkeypatch):
    """A BVH file whose names nobody has described, in inches and of an animal twice as large as AI4Animation's dog."""
    points = 2.0 * generate(DogGait(), 181).points
    parents = {NAMES[name]: NAMES[parent] for name, parent in AI4ANIMATION_PARENTS.items()}
    named = {NAMES[name]: points[:, index] for index, name in enumerate(AI4ANIMATION)}
    monkeypatch.chdir(tmp_path)
    return write_bvh(tmp_path / "hound.bvh", named, parents, unit=0.0254)


def test_an_unknown_file_is_measured_and_goes_to_a_clip_in_two_commands(hound, capsys):
    assert main(["motion", "new", hound.name]) == 0, capsys.readouterr().err
    assert hound.with_suffix(".png").stat().st_size > 10_000
    table = hound.with_suffix(".toml").read_text()
    assert main(["motion", "retarget", "hound", "--catalogue", "hound.toml", "--out", "clips"]) == 2
    assert "hound.toml, line" in (error := capsys.readouterr().err)
    assert "licence is empty" in error
    hound.with_suffix(".toml").write_text(table.replace('licence = ""', 'licence = "CC BY 4.0"'))
    assert main(["motion", "retarget", "hound", "--catalogue", "hound.toml", "--out", "clips"]) == 0
    clip = MotionClip.load(hound.parent / "clips" / "hound.npz")
    assert (clip.origin.source, clip.origin.file, clip.origin.licence) == ("hound", "hound.bvh", "CC BY 4.0")
    # The generated dog goes at one speed; a robot of half the size per second as far as its scale says.
    measured = load_catalogue(hound.with_suffix(".toml"))["hound"].motion_source
    speed = np.hypot(clip.cycle.x, clip.cycle.y) / clip.period
    assert speed == pytest.approx(2.0 * DogGait().speed * measured.scale, rel=0.02)


def test_what_a_file_is_taken_for_is_measured(hound):
    found = introduce(OwnFile(hound, ""), GO2)
    lines = dict(found.lines())
    assert found.is_new
    assert lines["axes"] == "inches, y up, right-handed"
    assert found.cycle is not None
    stride = (found.cycle.end - found.cycle.start) / DogGait().stride_frames
    assert stride == pytest.approx(round(stride), abs=1e-9)


def test_a_file_that_exists_is_not_overwritten(hound, capsys):
    hound.with_suffix(".toml").write_text("mine")
    assert main(["motion", "new", hound.name]) == 2
    assert "is there already" in capsys.readouterr().err
    assert hound.with_suffix(".toml").read_text() == "mine"


def test_a_file_goes_to_a_clip_in_one_command(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_amp(tmp_path / "my trot.txt")
    command = ["motion", "retarget", "my trot.txt", "--frames", "5:30", "--out", "clips"]
    assert main(command) == 2
    assert "--licence" in capsys.readouterr().err
    assert main([*command, "--licence", "own", "--citation", "me"]) == 0, capsys.readouterr().err
    clip = MotionClip.load(tmp_path / "clips" / "my_trot.npz")
    assert (clip.origin.source, clip.origin.licence, clip.origin.citation) == ("amp", "own", "me")
    assert main([*command, "--licence", "own", "--name", "../up"]) == 2
    assert "no name for a motion" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["no.bvh"], "no.bvh: no such motion file"),
        (["a.pkl", "b.pkl", "--name", "c"], "--frames and --name are for one file"),
        (["a.pkl", "--frames", "3-9"], "expected START:END"),
        (["a.pkl", "--frames", "50:90"], "are not within its 60 frames"),
        (["a.pkl", "--source", "amp"], "a.pkl"),
        (["a.pkl", "--source", "nobody"], "unknown motion source 'nobody'"),
        (["a.pkl", "sub/a.pkl"], "two motions would be named 'a'"),
    ],
)
def test_wrong_files_and_options_end_with_one_line(tmp_path, monkeypatch, capsys, arguments, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sub").mkdir()
    for name in ("a.pkl", "b.pkl", "sub/a.pkl"):
        write_pickle(tmp_path / name)
    assert main(["motion", "retarget", *arguments, "--licence", "own", "--out", "clips"]) == 2
    error = capsys.readouterr().err.strip()
    assert message in error
    assert len(error.splitlines()) == 1


def test_a_recipe_holds_motions_and_sources_of_its_own(hound):
    introduced = introduce(OwnFile(hound, ""), GO2).toml("hound").replace('licence = ""', 'licence = "own"')
    write_amp(hound.with_name("trot.txt"))
    recipe = hound.with_name("mine.toml")
    motion = {"name": "trot", "file": "trot.txt", "source": "amp", "licence": "own", "citation": "me", "mode": "plain"}
    lines = "\n".join(f'{key} = "{value}"' for key, value in motion.items())
    recipe.write_text('name = "mine"\n' + introduced + "\n[[motion]]\n" + lines)
    loaded = load_recipe(recipe)
    assert loaded.motions == ("hound", "trot")
    entries = [Job(name, loaded, Workspace(hound.parent / "run"), None, "cpu").entry for name in loaded.motions]
    assert [entry.is_there(None) for entry in entries] == [True, True]
    assert [entry.mode for entry in entries] == ["", "plain"]
    recipe.write_text('name = "mine"\ncatalogue = "other.toml"\n' + introduced)
    with pytest.raises(RecipeError, match="names a catalogue"):
        load_recipe(recipe)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('up = "y"', 'up = "north"'), r"line \d+, \[source\.hound\]: 'up' is \"north\"; allowed are: x, y, z"),
        (('neck = "Neck"\n', ""), "points must name pelvis, neck"),
        (("scale = ", "size = "), "unknown key"),
        (("[source.hound]", "[source.amp]"), r"\[source\.amp\] is the name of a source of the package"),
        (('source = "hound"', 'source = "hund"'), "unknown motion source 'hund'"),
    ],
)
def test_a_wrong_table_is_named(hound, change, message):
    table = introduce(OwnFile(hound, ""), GO2).toml("hound").replace('licence = ""', 'licence = "own"')
    if change[0] == "[source.hound]":
        table = table.replace("[source.hound.points]", "[source.amp.points]")
    assert change[0] in table
    hound.with_suffix(".toml").write_text(table.replace(*change))
    with pytest.raises((CatalogueError, ClipError), match=message):
        load_catalogue(hound.with_suffix(".toml"))["hound"].motion_source.load(hound)


def test_a_table_whose_columns_are_named_in_another_way_is_measured(tmp_path):
    points = dog(121)
    columns = [f"{name}.{axis}" for name in TABLE_NAMES for axis in "xyz"]
    rows = np.concatenate([np.arange(121)[:, None] / 60.0, 100.0 * points.reshape(121, -1)], axis=1)
    np.savetxt(tmp_path / "amp.csv", rows, delimiter=",", header=",".join(["time", *columns]), comments="")
    found = introduce(OwnFile(tmp_path / "amp.csv", ""), GO2)
    assert found.source.name == "my_amp"
    assert dict(found.lines())["axes"] == "centimetres, z up, right-handed"
    np.testing.assert_allclose(found.motion.position, points, atol=1e-6)
