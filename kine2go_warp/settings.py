"""Settings: frozen dataclasses to and from plain dictionaries, checked strictly."""

import hashlib
import json
from collections.abc import Callable, Iterator
from dataclasses import asdict, fields, is_dataclass
from typing import Any, TypeVar, get_type_hints

import dacite

from kine2go_warp.errors import Kine2GoError

Settings = TypeVar("Settings")


def to_dictionary(settings: Any) -> dict[str, Any]:
    """Return settings as nested dictionaries of JSON values."""
    return json.loads(json.dumps(asdict(settings)))


def from_dictionary(
    kind: type[Settings],
    values: dict[str, Any],
    where: str,
    error: type[Kine2GoError] = Kine2GoError,
    locate: Callable[[str], str] = lambda _: "",
) -> Settings:
    """Build settings from nested dictionaries.

    Args:
        kind: The dataclass to build.
        values: Its fields.
        where: Name of the file, for the message.
        error: Type of error to raise.
        locate: Returns what is to be said after ``where`` of the place of a key, such as ``train.seed``; of an empty
            key, that of all of them.

    Raises:
        Kine2GoError: a key is unknown or missing, or a value is of the wrong type; the message names it.
    """
    unknown = sorted(unknown_keys(kind, values))
    if unknown:
        raise error(f"{where}{locate(unknown[0])}: unknown key(s): {', '.join(unknown)}")
    config = dacite.Config(strict=True, type_hooks={float: _as_float, tuple: tuple}, cast=[tuple])
    try:
        return dacite.from_dict(kind, values, config)
    except dacite.DaciteFieldError as problem:
        raise error(f"{where}{locate(problem.field_path or '')}: {problem}") from None
    except (TypeError, ValueError, Kine2GoError, dacite.DaciteError) as problem:
        raise error(f"{where}{locate('')}: {problem}") from None


def unknown_keys(kind: type, values: dict[str, Any], path: str = "") -> Iterator[str]:
    """Yield the keys of nested dictionaries that settings do not have, such as ``train.itertions``."""
    types = get_type_hints(kind)
    known = {field.name for field in fields(kind)}
    for name, value in values.items():
        if name not in known:
            yield f"{path}{name}"
        elif is_dataclass(types[name]) and isinstance(value, dict):
            yield from unknown_keys(types[name], value, f"{path}{name}.")  # pyright: ignore[reportArgumentType]


def content_hash(*parts: Any) -> str:
    """Return a short hash of JSON values, to tell whether a result was made with the same inputs and settings."""
    text = json.dumps(parts, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _as_float(value: Any) -> float:
    """Let whole numbers stand for real ones, but nothing else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"expected a number, got {value!r}")
    return float(value)
