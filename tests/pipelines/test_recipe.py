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
    assert set(recipe.motions) <= set(load_catalogue())


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name = 'a'", "motions"),
        ("name = 'a'\nmotions = []", "'motions' is empty"),
        ("name = 'a'\nmotions = ['dog_trot']\nspeed = 3", "unknown key.*speed"),
        ("name = 'a'\nmotions = ['dog_trot']\n[train]\nitertions = 3", "unknown key.*itertions"),
        ("name = 'a'\nmotions = ['dog_trot']\n[gather]\nrows = 'many'", "gather.rows"),
        ("name = 'a'\nmotions = ['dog_trot']\n[gather]\nrows = 1", "rows at least 2"),
        ("name = ", "cannot be read as TOML"),
    ],
)
def test_a_wrong_recipe_is_refused_with_file_and_key(tmp_path, text, message):
    path = tmp_path / "recipe.toml"
    path.write_text(text)
    with pytest.raises(RecipeError, match=message) as error:
        load_recipe(path)
    assert str(path) in str(error.value)


def test_a_missing_recipe_lists_the_bundled_ones():
    with pytest.raises(RecipeError, match="bundled ones are: demo, smoke"):
        load_recipe(Path("nothing"))
