"""A recipe: which motions to take through all stages, and with which settings."""

import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

from kine2go_warp.errors import Kine2GoError, RecipeError
from kine2go_warp.learning.presets import FAST, Preset, base_preset
from kine2go_warp.motions.catalogue import load_catalogue
from kine2go_warp.motions.catalogue_entry import twin_name
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.robots import DEFAULT_ROBOT, robot_named
from kine2go_warp.rollouts.config import GatherConfig
from kine2go_warp.settings import check_ranges, from_dictionary, set_at
from kine2go_warp.toml import place_in, read_toml

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

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            Kine2GoError: a value is outside.
        """
        check_ranges(self, trajectories=(0, 10_000))


@dataclass(frozen=True)
class Recipe:
    """Settings of a whole run."""

    name: str
    """Name of the folder that results go to."""
    motions: tuple[str, ...]
    """Names of catalogue entries; with ``*`` all that it stands for."""
    catalogue: str = ""
    """TOML file with motions of your own, in the form of the catalogue; the recipe itself where it has [[motion]]."""
    robot: str = DEFAULT_ROBOT
    """Name of a robot, or FILE.py:NAME for one of your own."""
    accept: tuple[str, ...] = ()
    """Motions that are trained on even if their clip has gross faults."""
    retarget: RetargetConfig = field(default_factory=RetargetConfig)
    train: Preset = FAST
    gather: GatherConfig = field(default_factory=GatherConfig)
    score: ScoreConfig = field(default_factory=ScoreConfig)
    record: RecordConfig = field(default_factory=RecordConfig)

    @property
    def own_catalogue(self) -> Path | None:
        """File of the user's own catalogue."""
        return Path(self.catalogue) if self.catalogue else None


def load_recipe(path: Path, overrides: Sequence[str] = ()) -> Recipe:
    """Read a recipe.

    Args:
        path: A TOML file, or the name of a recipe that comes with the package, such as ``demo``.
        overrides: Settings that replace the recipe's, such as ``train.env.seed=2``; values as in TOML, quotes around
            texts may be left out.

    Raises:
        RecipeError: there is no such file, it is not TOML, or a key or value is wrong; the message names file and line.
            Or a setting is replaced twice.
    """
    bundled = RECIPE_FOLDER / f"{path}.toml"
    if not path.is_file() and path.parent == Path() and bundled.is_file():
        path = bundled
    if path.is_dir():
        raise RecipeError(f"{path}: a folder, not a recipe; name a TOML file in it")
    if not path.exists():
        known = ", ".join(sorted(recipe.stem for recipe in RECIPE_FOLDER.glob("*.toml")))
        raise RecipeError(f"{path}: no such recipe; bundled ones are: {known}")
    values, text = read_toml(path, RecipeError)
    take_catalogue(values, path)
    recipe = check_recipe(values, str(path), text)
    if overrides:
        keys = [one.partition("=")[0].strip() for one in overrides]
        if twice := next((key for key in keys if keys.count(key) > 1), None):
            raise RecipeError(f"--set {twice}: is given {keys.count(twice)} times; leave out all but one")
        for one in overrides:
            apply_override(values, one)
        recipe = check_recipe(values, "--set")
    return recipe


def take_catalogue(values: dict[str, Any], path: Path) -> None:
    """Make a recipe that holds motions of its own, as a catalogue does, its own catalogue.

    Raises:
        RecipeError: it names another catalogue, too.
    """
    own = {key: values.pop(key) for key in ("source", "collection", "motion") if key in values}
    if not own:
        return
    if "catalogue" in values:
        raise RecipeError(f"{path}: has [[motion]] and names a catalogue; put the motions into one of the two")
    values["catalogue"] = str(path.resolve())
    names = []
    for one in own.get("motion", []):
        if isinstance(one, dict):
            names += [one.get("name")] + ([twin_name(str(one.get("name")))] if one.get("mirror") else [])
    values.setdefault("motions", names)


def check_recipe(values: dict[str, Any], where: str, text: str = "") -> Recipe:
    """Turn a recipe's values into settings.

    Args:
        values: What the file holds.
        where: Name of the file.
        text: Text of the file, to name lines.

    Raises:
        RecipeError: a key or value is wrong.
    """
    locate = partial(place_in, text)

    def refuse(key: str, message: str) -> NoReturn:
        raise RecipeError(f"{where}{locate(key)}: {message}")

    base = Recipe("", (), train=base_preset(values.get("train"), where, RecipeError, locate))
    recipe = from_dictionary(Recipe, values, where, RecipeError, locate, base)
    if not recipe.motions:
        refuse("motions", "'motions' is empty; name at least one motion of the catalogue")
    try:
        recipe = replace(recipe, motions=named_motions(recipe))
    except Kine2GoError as error:
        refuse("motions", str(error))
    for motion in recipe.motions:
        if recipe.motions.count(motion) > 1:
            refuse("motions", f"'motions' names {motion} more than once")
    if unknown := sorted(set(recipe.accept) - set(recipe.motions)):
        refuse("accept", f"'accept' names {', '.join(unknown)}, not among 'motions'")
    try:
        robot_named(recipe.robot)
    except Kine2GoError as error:
        refuse("robot", str(error))
    if not recipe.name:
        raise RecipeError(f"{where}: 'name' is missing or empty; results go to runs/NAME")
    if not re.fullmatch(r"[\w.-]+", recipe.name) or recipe.name.startswith("."):
        refuse("name", f"name '{recipe.name}' is no name of a folder")
    return recipe


def named_motions(recipe: Recipe) -> tuple[str, ...]:
    """Return the recipe's motions with the names in the place of patterns such as ``ai4_dog_*``.

    Raises:
        Kine2GoError: the catalogue cannot be read, or has no motion of a pattern.
    """
    found: list[str] = []
    for motion in recipe.motions:
        if "*" not in motion:
            found.append(motion)
            continue
        known = load_catalogue(recipe.own_catalogue)
        names = [name for name in known if fnmatchcase(name, motion)]
        if not names:
            raise RecipeError(f"'motions' has '{motion}', and the catalogue no motion of such a name")
        found += names
    return tuple(found)


def apply_override(values: dict[str, Any], override: str) -> None:
    """Replace one setting.

    Raises:
        RecipeError: it is not of the form KEY=VALUE, or a part of the key is no section.
    """
    key, equals, text = override.partition("=")
    if not equals or not key.strip():
        raise RecipeError(f"--set {override}: expected KEY=VALUE, such as train.ppo.iterations=200")
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except ValueError:
        value = text.strip()
    try:
        set_at(values, key.strip(), value)
    except Kine2GoError as error:
        raise RecipeError(f"--set {override}: {error} of the recipe") from None
