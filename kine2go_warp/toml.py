"""TOML files of settings: reading them, naming the line of a key, and writing them."""

import json
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from kine2go_warp.errors import Kine2GoError
from kine2go_warp.settings import NOTHING


def read_toml(path: Path, error: type[Kine2GoError] = Kine2GoError) -> tuple[dict[str, Any], str]:
    """Return the values and the text of a TOML file.

    Raises:
        Kine2GoError: there is no such file, or it is not TOML.
    """
    try:
        text = path.read_text(encoding="utf-8")
        return tomllib.loads(text), text
    except FileNotFoundError:
        raise error(f"{path}: no such file") from None
    except IsADirectoryError:
        raise error(f"{path}: a folder, not a TOML file") from None
    except (OSError, ValueError) as problem:
        raise error(f"{path}: cannot be read as TOML ({problem})") from None


def to_toml(values: dict[str, Any], section: str = "") -> str:
    """Return nested dictionaries of JSON values as TOML."""
    plain = {name: value for name, value in values.items() if not isinstance(value, dict)}
    lines = [f"[{section}]"] if section and plain else []
    lines += [f"{name} = {json.dumps(NOTHING if value is None else value)}" for name, value in plain.items()]
    blocks = ["\n".join(lines) + "\n"] if lines else []
    for name, value in values.items():
        if isinstance(value, dict):
            blocks.append(to_toml(value, f"{section}.{name}" if section else name))
    return "\n".join(block for block in blocks if block)


def place_in(text: str, key: str) -> str:
    """Return line and section of a key such as ``train.env.seed``, as messages have them."""
    line = next((line for part in ancestors(key) if (line := find_line(text, part))), None)
    section = key if find_line(text, key, sections=True) else key.rpartition(".")[0]
    return (f", line {line}" if line else "") + (f", [{section}]" if section else "")


def ancestors(key: str) -> Iterator[str]:
    """Yield a key and the sections that it is in, inner ones first."""
    while key:
        yield key
        key = key.rpartition(".")[0]


def find_line(text: str, key: str, sections: bool = False) -> int | None:
    """Return the number of the line where a key such as ``train.env.seed``, or a section, stands; none if not found."""
    section = ""
    for number, line in enumerate(text.splitlines(), start=1):
        header = re.match(r"\s*\[\s*([\w.\s-]+?)\s*\]", line)
        if header:
            section = header.group(1)
            if section == key:
                return number
        name = re.match(r"\s*([\w.-]+)\s*=", line)
        found = name and (f"{section}.{name.group(1)}" if section else name.group(1))
        if found == key and not sections:
            return number
    return None
