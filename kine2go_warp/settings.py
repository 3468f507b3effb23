"""Settings: frozen dataclasses to and from plain dictionaries, checked strictly."""

import hashlib
import json
from dataclasses import asdict
from typing import Any, TypeVar

import dacite

from kine2go_warp.errors import Kine2GoError

Settings = TypeVar("Settings")


def to_dictionary(settings: Any) -> dict[str, Any]:
    """Return settings as nested dictionaries of JSON values."""
    return json.loads(json.dumps(asdict(settings)))


def from_dictionary(
    kind: type[Settings], values: dict[str, Any], where: str, error: type[Kine2GoError] = Kine2GoError
) -> Settings:
    """Build settings from nested dictionaries.

    Args:
        kind: The dataclass to build.
        values: Its fields.
        where: Name of the file, for the message.
        error: Type of error to raise.

    Raises:
        Kine2GoError: a key is unknown or missing, or a value is of the wrong type; the message names it.
    """
    config = dacite.Config(strict=True, type_hooks={float: _as_float, tuple: tuple}, cast=[tuple])
    try:
        return dacite.from_dict(kind, values, config)
    except dacite.UnexpectedDataError as problem:
        raise error(f"{where}: unknown key(s): {', '.join(sorted(problem.keys))}") from None
    except dacite.DaciteFieldError as problem:
        raise error(f"{where}: {problem}") from None
    except (TypeError, ValueError, Kine2GoError) as problem:
        raise error(f"{where}: {problem}") from None


def content_hash(*parts: Any) -> str:
    """Return a short hash of JSON values, to tell whether a result was made with the same inputs and settings."""
    text = json.dumps(parts, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _as_float(value: Any) -> float:
    """Let whole numbers stand for real ones, but nothing else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"expected a number, got {value!r}")
    return float(value)
