"""Settings: frozen dataclasses to and from plain dictionaries and TOML, checked strictly.

A tuple of ``Named`` records, such as the terms of an environment, is a section by name: the field ``weight`` of the
record ``joint_position`` in ``rewards`` is ``rewards.joint_position.weight``. Pairs of a name and a number are a
section, too.
"""

import difflib
import hashlib
import json
import math
from collections.abc import Callable, Iterator
from dataclasses import MISSING, dataclass, fields, is_dataclass, replace
from types import NoneType, UnionType
from typing import Any, ClassVar, Literal, NoReturn, TypeVar, Union, get_args, get_origin, get_type_hints

from kine2go_warp.errors import Kine2GoError

Settings = TypeVar("Settings")

NOTHING = "none"
"""Stands for ``None`` where a file cannot say it."""

EXPECTED = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}
PLAIN = (bool, int, float, str, NoneType)
PAIR = tuple[str, float]


@dataclass(frozen=True)
class Named:
    """A record that settings address by its name, within a tuple of such records."""

    main_field: ClassVar[str] = ""
    """Field whose value may stand for the whole record, where the others keep their defaults."""

    name: str


def to_dictionary(settings: Any) -> dict[str, Any]:
    """Return settings as nested dictionaries of JSON values."""
    return _plain(settings)


def from_dictionary(
    kind: type[Settings],
    values: dict[str, Any],
    where: str,
    error: type[Kine2GoError] = Kine2GoError,
    locate: Callable[[str], str] = lambda _: "",
    base: Settings | None = None,
) -> Settings:
    """Build settings from nested dictionaries.

    Args:
        kind: The dataclass to build.
        values: Its fields; a part of them where ``base`` or the class has the others.
        where: Name of the file, for the message.
        error: Type of error to raise.
        locate: Returns what the message adds to ``where`` for a key, such as ``train.seed``; the empty key is all of
            them.
        base: Settings that the values replace a part of.

    Raises:
        Kine2GoError: a key is unknown or missing, or a value is of the wrong type or impossible; the message names it.
    """
    return _Reader(kind, base, where, error, locate).record(kind, values, base, "")


def override(settings: Settings, values: dict[str, Any], where: str = "settings") -> Settings:
    """Return settings with some values replaced, each by its path, such as ``{"env.motor.stiffness": 40.0}``.

    Raises:
        Kine2GoError: there is no such setting, or a value is of the wrong type or impossible.
    """
    nested: dict[str, Any] = {}
    for path, value in values.items():
        set_at(nested, path, value)
    return from_dictionary(type(settings), nested, where, base=settings)


def set_at(values: dict[str, Any], path: str, value: Any) -> None:
    """Put a value into nested dictionaries, at a path such as ``env.motor.stiffness``.

    Raises:
        Kine2GoError: a part of the path is a value, not a section.
    """
    *sections, name = path.split(".")
    for section in sections:
        values = values.setdefault(section, {})
        if not isinstance(values, dict):
            raise Kine2GoError(f"'{section}' is not a section")
    values[name] = value


def check_ranges(settings: Any, **ranges: tuple[float, float]) -> None:
    """Check that numbers, or all of a tuple's, are finite and between a least and a greatest; ``None`` is left out.

    Raises:
        Kine2GoError: one is not.
    """
    for name, (least, greatest) in ranges.items():
        found = getattr(settings, name)
        for value in found if isinstance(found, tuple) else (found,):
            if value is not None and not (least <= value <= greatest and math.isfinite(value)):
                shown = list(found) if isinstance(found, tuple) else found
                raise Kine2GoError(f"{name} is {shown}; it must be {range_text(least, greatest)}")


def range_text(least: float, greatest: float) -> str:
    """Return what a number between a least and a greatest is, in words."""
    if math.isfinite(greatest):
        return f"from {least:,.10g} to {greatest:,.10g}"
    return "positive" if 0.0 < least < 1e-6 else f"at least {least:,.10g}"


def content_hash(*parts: Any) -> str:
    """Return a short hash of JSON values, to tell whether a result was made with the same inputs and settings."""
    text = json.dumps(parts, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def are_named(value: Any) -> bool:
    """Return whether a value is a tuple of records that are addressed by name."""
    return isinstance(value, tuple) and bool(value) and all(isinstance(one, Named) for one in value)


def are_pairs(value: Any) -> bool:
    """Return whether a value is a tuple of pairs of a name and a number."""
    return (
        isinstance(value, tuple)
        and bool(value)
        and all(isinstance(one, tuple) and len(one) == 2 and isinstance(one[0], str) for one in value)
    )


@dataclass(frozen=True)
class _Reader:
    """Builds one tree of settings and says what is wrong with its values."""

    kind: type
    base: Any
    where: str
    error: type[Kine2GoError]
    locate: Callable[[str], str]

    def record(self, kind: Any, values: Any, base: Any, path: str) -> Any:
        """Return a dataclass of some values, laid over ``base`` or the defaults of its class."""
        if isinstance(values, kind):
            return values
        if not isinstance(values, dict):
            self.refuse(path, f"'{path}' must be a section, not {json.dumps(values)}")
        known = {field.name: field for field in fields(kind) if field.init}
        for name in values:
            if name not in known:
                self.refuse_key(_join(path, name), [_join(path, one) for one in known])
        types, given = get_type_hints(kind), {}
        for name, value in values.items():
            before = _default(known[name]) if base is None else getattr(base, name)
            given[name] = self.value(types[name], value, before, _join(path, name))
        missing = [name for name, one in known.items() if base is None and name not in given and not _has_default(one)]
        if missing:
            self.refuse(path, f"'{_join(path, missing[0])}' is missing")
        try:
            return kind(**given) if base is None else replace(base, **given)
        except (Kine2GoError, ValueError, TypeError) as problem:
            # Checks of a class begin with the name of the field that they refuse.
            name = str(problem).split(" ", 1)[0]
            self.refuse(_join(path, name) if name in given else path, str(problem))

    def value(self, kind: Any, value: Any, base: Any, path: str) -> Any:
        """Return a value of a field, as its type hint wants it."""
        origin, arguments = get_origin(kind), get_args(kind)
        if origin in (Union, UnionType):
            inner = next(one for one in arguments if one is not NoneType)
            return None if value is None or value == NOTHING else self.value(inner, value, base, path)
        if is_dataclass(kind):
            return self.record(kind, value, base, path)
        if origin is tuple:
            return self.sequence(arguments, value, base, path)
        if origin is dict:
            if not isinstance(value, dict):
                self.refuse(path, f"'{path}' must be a section, not {json.dumps(value)}")
            return {name: self.value(arguments[1], one, None, _join(path, name)) for name, one in value.items()}
        return value if kind is Any else self.plain(kind, value, path)

    def plain(self, kind: Any, value: Any, path: str) -> Any:
        """Return a number or text; whole numbers may stand for real ones, but nothing else for anything."""
        if get_origin(kind) is Literal:
            if value not in get_args(kind):
                allowed = ", ".join(map(str, get_args(kind)))
                self.refuse(path, f"'{path}' is {json.dumps(value)}; allowed are: {allowed}")
            return value
        kinds = (int, float) if kind is float else kind
        if not isinstance(value, kinds) or (isinstance(value, bool) and kind is not bool):
            self.refuse(path, f"'{path}' must be {EXPECTED[kind]}, not {json.dumps(value)}")
        if kind is float and not math.isfinite(value):
            self.refuse(path, f"'{path}' is {value}; it must be finite")
        return kind(value)

    def sequence(self, arguments: tuple[Any, ...], value: Any, base: Any, path: str) -> tuple[Any, ...]:
        """Return a tuple, of a list, or of a section for what is addressed by name."""
        if isinstance(value, dict) and (arguments[0] == PAIR or _is_named(arguments[0])):
            return self.section(arguments[0], value, base, path)
        any_number = len(arguments) == 2 and arguments[1] is Ellipsis
        kinds = [arguments[0]] * len(value) if any_number and isinstance(value, list | tuple) else list(arguments)
        if not isinstance(value, list | tuple) or len(value) != len(kinds):
            size = "a list" if any_number else f"a list of {len(arguments)}"
            self.refuse(path, f"'{path}' must be {size}, not {json.dumps(value)}")
        return tuple(self.value(kind, one, None, path) for kind, one in zip(kinds, value, strict=True))

    def section(self, kind: Any, values: dict[str, Any], base: Any, path: str) -> tuple[Any, ...]:
        """Return pairs or named records, those of ``base`` with what is given replaced, or all of them without it."""
        if kind == PAIR:
            before = {} if self.base is None else dict(base)
            if self.base is not None and (unknown := next((name for name in values if name not in before), None)):
                self.refuse_key(_join(path, unknown), [_join(path, one) for one in before])
            given = {name: self.plain(float, value, _join(path, name)) for name, value in values.items()}
            return tuple({**before, **given}.items())
        records = {} if self.base is None else {one.name: one for one in base}
        for name, value in values.items():
            old, where = records.get(name), _join(path, name)
            if old is None and self.base is not None and not _is_complete(kind, value):
                self.refuse_key(where, [_join(path, one) for one in records])
            if kind.main_field and not isinstance(value, dict):
                value = {kind.main_field: value}  # noqa: PLW2901
            given = {"name": name, **value} if isinstance(value, dict) and old is None else value
            records[name] = self.record(kind if old is None else type(old), given, old, where)
        return tuple(records.values())

    def refuse_key(self, path: str, siblings: list[str]) -> NoReturn:
        """Name an unknown key, and those of the whole tree that look like it, or else its neighbours."""
        ends: dict[str, list[str]] = {}
        for known in [*siblings, *_paths(self.kind, self.base, "")]:
            ends.setdefault(known.rpartition(".")[2], []).append(known)
        close = difflib.get_close_matches(path.rpartition(".")[2], ends, 3, 0.7)
        near = list(dict.fromkeys(known for end in close for known in ends[end]))
        hint = f"near ones are: {', '.join(near)}" if near else f"known are: {', '.join(siblings)}"
        self.refuse(path, f"unknown key '{path}'; {hint}")

    def refuse(self, path: str, message: str) -> NoReturn:
        """Raise the error of one key."""
        raise self.error(f"{self.where}{self.locate(path)}: {message}") from None


def _paths(kind: Any, base: Any, path: str) -> Iterator[str]:
    """Yield the paths of all settings of a class, such as ``env.motor.stiffness``."""
    types = get_type_hints(kind)
    for field in fields(kind):
        value = _default(field) if base is None else getattr(base, field.name)
        where = _join(path, field.name)
        yield where
        if are_pairs(value):
            yield from (_join(where, name) for name, _ in value)
        elif are_named(value):
            for one in value:
                yield from (_join(where, one.name), *_paths(type(one), one, _join(where, one.name)))
        elif is_dataclass(types[field.name]):
            yield from _paths(types[field.name], value, where)


def _plain(value: Any) -> Any:
    """Return a value as JSON has it."""
    if are_named(value):
        return {one.name: _shortest(one) for one in value}
    if is_dataclass(value):
        return _parts(value)
    if isinstance(value, dict):
        return {str(name): _plain(part) for name, part in value.items()}
    if are_pairs(value):
        return dict(value)
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    if not isinstance(value, PLAIN):
        raise TypeError(f"{value!r} is no setting that a file can hold")
    return value


def _parts(record: Any) -> dict[str, Any]:
    """Return the fields of a record, but for the name where it is addressed by that."""
    hidden = {"name"} if isinstance(record, Named) else set()
    return {one.name: _plain(getattr(record, one.name)) for one in fields(record) if one.name not in hidden}


def _shortest(record: Named) -> Any:
    """Return the fields of a record, or the value of its main field where the others keep their defaults."""
    main = record.main_field
    others = [one for one in fields(record) if one.name not in ("name", main)]
    if main and all(getattr(record, one.name) == _default(one) for one in others):
        return _plain(getattr(record, main))
    return _parts(record)


def _is_named(kind: Any) -> bool:
    """Return whether a class is that of records that are addressed by name."""
    return isinstance(kind, type) and issubclass(kind, Named)


def _is_complete(kind: Any, values: Any) -> bool:
    """Return whether values hold all that a new record of a class needs besides its name."""
    needed = {one.name for one in fields(kind) if not _has_default(one)} - {"name"}
    return isinstance(values, dict) and needed <= set(values)


def _has_default(field: Any) -> bool:
    """Return whether a field may be left out."""
    return field.default is not MISSING or field.default_factory is not MISSING


def _default(field: Any) -> Any:
    """Return the default of a field, none if it has none."""
    if field.default_factory is not MISSING:
        return field.default_factory()
    return None if field.default is MISSING else field.default


def _join(path: str, name: str) -> str:
    """Return the path of a field within a section."""
    return f"{path}.{name}" if path else name
