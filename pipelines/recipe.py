"""A recipe: which motions to take through all stages, and with which settings."""

import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from kine2go_warp.errors import RecipeError
from kine2go_warp.learning.config import TrainConfig
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.rollouts.config import GatherConfig
from kine2go_warp.settings import from_dictionary

RECIPE_FOLDER = Path(__file__).parent


@dataclass(frozen=True)
class ScoreConfig:
    """Settings of the scoring stage."""

    enabled: bool = True
    """Whether motions are scored at all."""


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
    accept: tuple[str, ...] = ()
    """Motions that are trained on even if their clip has gross faults."""
    retarget: RetargetConfig = field(default_factory=RetargetConfig)
    train: TrainConfig = field(default_factory=TrainConfig)
    gather: GatherConfig = field(default_factory=GatherConfig)
    score: ScoreConfig = field(default_factory=ScoreConfig)
    record: RecordConfig = field(default_factory=RecordConfig)


def load_recipe(path: Path, overrides: Sequence[str] = ()) -> Recipe:
    """Read a recipe.

    Args:
        path: A TOML file, or the name of a recipe that comes with the package, such as ``demo``.
        overrides: Settings that replace the recipe's, such as ``train.seed=2``; values as in TOML, without quotes if
            you like.

    Raises:
        RecipeError: there is no such file, it is not TOML, or a key or value is wrong; the message names file and line.
    """
    bundled = RECIPE_FOLDER / f"{path}.toml"
    if not path.exists() and path.parent == Path() and bundled.is_file():
        path = bundled
    try:
        text = path.read_text(encoding="utf-8")
        values = tomllib.loads(text)
    except FileNotFoundError:
        known = ", ".join(sorted(recipe.stem for recipe in RECIPE_FOLDER.glob("*.toml")))
        raise RecipeError(f"{path}: no such recipe; bundled ones are: {known}") from None
    except (OSError, ValueError) as error:
        raise RecipeError(f"{path}: cannot be read as TOML ({error})") from None
    recipe = checked(values, text, str(path))
    if overrides:
        for override in overrides:
            apply_override(values, override)
        recipe = checked(values, "", "--set")
    return recipe


def checked(values: Mapping[str, Any], text: str, where: str) -> Recipe:
    """Turn a recipe's values into settings.

    Raises:
        RecipeError: a key or value is wrong.
    """

    def locate(section: str, key: str = "") -> str:
        """Return line and section of a key."""
        line = line_of(text, f"{section}.{key}" if section and key else section or key)
        return (f", line {line}" if line else "") + (f", [{section}]" if section else "")

    kinds = {"retarget": RetargetConfig, "train": TrainConfig, "gather": GatherConfig}
    for section, kind in kinds.items():
        # Section by section first, so that the message names the section whose values do not go together.
        if isinstance(values.get(section), dict):
            from_dictionary(kind, values[section], where, RecipeError, partial(locate, section))
    recipe = from_dictionary(Recipe, dict(values), where, RecipeError, partial(locate, ""))
    if not recipe.motions:
        raise RecipeError(
            f"{where}{locate('', 'motions')}: 'motions' is empty; name at least one motion of the catalogue"
        )
    unknown = sorted(set(recipe.accept) - set(recipe.motions))
    if unknown:
        raise RecipeError(f"{where}{locate('', 'accept')}: 'accept' names {', '.join(unknown)}, not among 'motions'")
    if not re.fullmatch(r"[\w.-]+", recipe.name) or recipe.name.startswith("."):
        raise RecipeError(f"{where}{locate('', 'name')}: name '{recipe.name}' is no name of a folder")
    return recipe


def apply_override(values: dict[str, Any], override: str) -> None:
    """Replace one setting.

    Raises:
        RecipeError: it is not of the form KEY=VALUE, or a part of the key is no section.
    """
    key, equals, text = override.partition("=")
    if not equals or not key.strip():
        raise RecipeError(f"--set {override}: expected KEY=VALUE, such as train.iterations=200")
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except ValueError:
        value = text.strip()
    *sections, name = key.strip().split(".")
    for section in sections:
        values = values.setdefault(section, {})
        if not isinstance(values, dict):
            raise RecipeError(f"--set {override}: '{section}' is not a section of the recipe")
    values[name] = value


def line_of(text: str, key: str) -> int | None:
    """Return the number of the line at which a key such as ``train.seed``, or a section, stands; none if not found."""
    section = ""
    for number, line in enumerate(text.splitlines(), start=1):
        header = re.match(r"\s*\[\s*([\w.\s-]+?)\s*\]", line)
        if header:
            section = header.group(1)
            if section == key:
                return number
        name = re.match(r"\s*([\w.-]+)\s*=", line)
        if name and (f"{section}.{name.group(1)}" if section else name.group(1)) == key:
            return number
    return None
