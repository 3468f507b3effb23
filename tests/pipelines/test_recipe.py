from pathlib import Path

import pytest

from kine2go_warp.errors import RecipeError
from kine2go_warp.motions.catalogue import load_catalogue
from kine2go_warp.pipelines.recipe import RECIPE_FOLDER, load_recipe


@pytest.mark.parametrize("path", sorted(RECIPE_FOLDER.glob("*.toml")), ids=lambda path: path.stem)
def test_bundled_recipes_are_valid_and_found_by_name(path):
    recipe = load_recipe(Path(path.stem))
    assert recipe == load_recipe(path)
    assert recipe.name == path.stem
    assert set(recipe.motions) <= set(load_catalogue(path if recipe.catalogue else None))


def test_the_recipes_of_the_paper_hold_its_motions():
    catalogue = load_catalogue()
    others = ("generated", "ai4animation_postures")
    papers = {name for name, entry in catalogue.items() if entry.collection not in others}
    assert set(load_recipe(Path("kine2go")).motions) == papers
    assert len(papers) == 40
    sample = {name for name in papers if catalogue[name].sample}
    # Its reference is no jump but a second ellipse walk.
    assert set(load_recipe(Path("sample")).motions) == sample - {"ai4_dog_synth_half_flip_jump"}


def test_the_catalogue_recipe_has_every_motion_of_the_paper_whose_clips_can_be_had():
    others = ("solo8", "ai4animation_postures")
    wanted = [name for name, one in load_catalogue().items() if one.collection not in others and not one.bundled]
    assert list(load_recipe(Path("catalogue")).motions) == wanted
    assert len(wanted) == 34


def test_the_smoke_recipe_has_a_motion_of_every_source_whose_clips_can_be_had():
    motions = [load_catalogue()[name] for name in load_recipe(Path("smoke")).motions]
    collections = {entry.collection for entry in load_catalogue().values()} - {"solo8", "ai4animation_postures"}
    assert {entry.collection for entry in motions} == collections
    assert len(motions) == len(collections)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name = 'a'", "motions"),
        ("name = 'a'\nmotions = []", "line 2: 'motions' is empty"),
        ("name = 'a'\nmotions = ['cat_*']", "line 2: 'motions' has 'cat_\\*', and the catalogue no motion of such a"),
        ("name = '../a'\nmotions = ['dog_trot']", "line 1: name '../a' is no name of a folder"),
        ("name = 'a'\nmotions = ['dog_trot']\nspeed = 3", "line 3: unknown key.*speed"),
        ("name = 'a'\nmotions = ['dog_trot']\n[train]\nitertions = 3", r"line 4, \[train\]: unknown key.*itertions"),
        ("name = 'a'\nmotions = ['b']\n[train.env]\nseed = 1\n[gather]\nrows = 'many'", r"line 6, \[gather\].*rows"),
        ("name = 'a'\nmotions = ['dog_trot']\n[gather]\nrows = 1", r"line 4, \[gather\]: rows is 1; it must be from 2"),
        ("name = 'a'\nmotions = ['b']\n[gather.randomization]\nfrction = [1, 2]", "unknown key.*randomization.frction"),
        ("name = 'a'\nmotions = ['b']\n[gather.diversity]\nlevel = 'huge'", "line 4.*huge.*paper, cloning, wide"),
        ("name = 'a'\nmotions = ['b']\n[gather.diversity]\nmirored = 0.5", "line 4.*unknown key.*diversity.mirrored"),
        ("name = 'a'\nmotions = ['b']\n[gather.diversity]\ntime_scale = [0.1, 1]", "line 4.*time_scale is .*from 0.5"),
        ("name = 'a'\nmotions = ['dog_trot']\n[record]\ntrajectories = 'all'", "line 4.*record.trajectories"),
        ("name = 'a'\nmotions =\n", "cannot be read as TOML.*line 2"),
    ],
)  # fmt: skip
def test_a_wrong_recipe_is_refused_with_file_line_and_key(tmp_path, text, message):
    path = tmp_path / "recipe.toml"
    path.write_text(text)
    with pytest.raises(RecipeError, match=message) as error:
        load_recipe(path)
    assert str(path) in str(error.value)


def test_a_level_of_diversity_may_have_single_values_replaced(tmp_path):
    path = tmp_path / "recipe.toml"
    path.write_text("name = 'a'\nmotions = ['dog_trot']\n[gather.diversity]\nlevel = 'wide'\nmirrored = 0.0")
    diversity = load_recipe(path).gather.diversity.resolved()
    assert (diversity.mirrored, diversity.time_scale) == (0.0, (0.85, 1.15))


def test_a_missing_recipe_lists_the_bundled_ones():
    with pytest.raises(RecipeError, match="bundled ones are: catalogue, demo, kine2go, own, sample, smoke"):
        load_recipe(Path("nothing"))


def test_settings_can_be_replaced_one_by_one():
    recipe = load_recipe(
        Path("demo"), ["train.preset=paper", "gather.action_noise_scale=[0.1, 0.2]", "record.trajectories=0"]
    )
    assert recipe.train.preset == "paper"
    assert recipe.gather.action_noise_scale == (0.1, 0.2)
    assert recipe.record.trajectories == 0
    assert recipe.motions == load_recipe(Path("demo")).motions


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("train.seed", "expected KEY=VALUE"),
        ("train.env.sed=1", "--set.*unknown key.*train.env.sed.*near ones are: train.env.seed"),
        ("train.env.seed=many", r"--set.*\[train.env\].*seed"),
        ("name.part=1", "'name' is not a section"),
    ],
)
def test_a_wrong_replacement_is_refused(override, message):
    with pytest.raises(RecipeError, match=message):
        load_recipe(Path("demo"), [override])


def test_a_setting_is_replaced_once():
    with pytest.raises(RecipeError, match=r"--set train\.env\.seed: is given 2 times; leave out all but one"):
        load_recipe(Path("demo"), ["train.env.seed=1", "record.trajectories=0", "train.env.seed = 2"])
