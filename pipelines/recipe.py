"""A recipe: which motions to take through all stages, and with which settings."""

import tomllib
from dataclasses import dataclass, field
from pathlib import Path

from kine2go_warp.errors import RecipeError
from kine2go_warp.learning.config import TrainConfig
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.rollouts.config import GatherConfig
from kine2go_warp.settings import from_dictionary

RECIPE_FOLDER = Path(__file__).parent


@dataclass(frozen=True)
class RecordConfig:
    """Settings of the recording stage."""

    trajectories: int = 3
    """Trajectories shown in each motion's recording; 0 writes none."""


@dataclass(frozen=True)
class Recipe:
    """Settings of a whole run."""

    name: str
    """Name of the folder that results go to."""
    motions: tuple[str, ...]
    """Names of catalogue entries."""
    retarget: RetargetConfig = field(default_factory=RetargetConfig)
    train: TrainConfig = field(default_factory=TrainConfig)
    gather: GatherConfig = field(default_factory=GatherConfig)
    record: RecordConfig = field(default_factory=RecordConfig)


def load_recipe(path: Path) -> Recipe:
    """Read a recipe.

    Args:
        path: A TOML file, or the name of a recipe that comes with the package, such as ``demo``.

    Raises:
        RecipeError: there is no such file, it is not TOML, or a key or value is wrong.
    """
    bundled = RECIPE_FOLDER / f"{path}.toml"
    if not path.exists() and path.parent == Path() and bundled.is_file():
        path = bundled
    try:
        values = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        known = ", ".join(sorted(recipe.stem for recipe in RECIPE_FOLDER.glob("*.toml")))
        raise RecipeError(f"{path}: no such recipe; bundled ones are: {known}") from None
    except (OSError, ValueError) as error:
        raise RecipeError(f"{path}: cannot be read as TOML ({error})") from None
    recipe = from_dictionary(Recipe, values, str(path), RecipeError)
    if not recipe.motions:
        raise RecipeError(f"{path}: 'motions' is empty; name at least one motion of the catalogue")
    return recipe
