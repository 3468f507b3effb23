"""Parsing of options, their help, and the error messages for wrong ones."""

import contextlib
import io
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from types import NoneType, UnionType
from typing import Annotated, Any, Union, get_args, get_type_hints

import tyro

from kine2go_warp.errors import Kine2GoError
from kine2go_warp.settings import Named, are_named, are_pairs

REGISTRY = tyro.constructors.ConstructorRegistry()
"""The package's own rules."""

UNSAID: tuple[Any, ...] = (None, False, (), "")
"""Defaults that help does not name, and no default: the text of the option says what happens without it."""

REWORDED = (
    (r"^Error parsing (\S+): ", r"\1: "),
    (r"no type matching (\S+) could be instantiated from \[(.*?)\].*", r"\2 is none of \1"),
    (r"^Missing from .*?: ", "missing: "),
    (r"\. Expected \d+ values", ""),
)
"""What tyro says, and the same for people who do not know its types."""


def parse(kind: Any, program: str, arguments: Sequence[str], default: Any = None) -> Any:
    """Return a command with its options; help ends the process.

    Args:
        kind: Class of the command.
        program: Its name.
        arguments: What stands after the name.
        default: A command with the defaults; by default those of the class.

    Raises:
        Kine2GoError: an option is wrong, in one line.
    """
    leave_defaults_unsaid(kind)
    more = {} if default is None else {"default": default}
    shown = io.StringIO()
    try:
        with contextlib.redirect_stderr(shown):
            return tyro.cli(
                kind, prog=program, args=arguments, config=(tyro.conf.OmitSubcommandPrefixes,), registry=REGISTRY,
                **more,
            )  # fmt: skip
    except SystemExit as end:
        if end.code in (None, 0):
            raise
        raise Kine2GoError(f"{condensed(shown.getvalue())}; '{program} --help' explains the options") from None


def condensed(box: str) -> str:
    """Return what tyro says of wrong arguments, a box of several lines, as one: what is wrong, and the nearest name."""
    # Lines of text begin with a bar and a space, or with two spaces where all is ASCII; the title does not.
    framed = [line[2:].rstrip("│ ") for line in box.splitlines() if re.match(r"[│ ] ", line)]
    lines = [line for line in framed or box.splitlines() if line.strip()]
    rules = [number for number, line in enumerate(lines) if set(line.strip()) <= set("─-")] or [len(lines)]
    first = [line for line in lines[: rules[0]] if not line.startswith(" " * 8)]
    said = " ".join(" ".join(first).split()) or "these arguments cannot be read"
    for pattern, better in REWORDED:
        said = re.sub(pattern, better, said)
    near = [line.split()[0].rstrip(",") for line in lines[rules[0] :] if re.match(r"\s*--\w", line)]
    is_unknown = said.startswith("Unrecognized")
    return said[0].lower() + said[1:].rstrip(".") + (f"; did you mean {near[0]}?" if near and is_unknown else "")


def leave_defaults_unsaid(kind: Any) -> None:
    """Make the help of a command's options leave out defaults such as ``None``."""
    for base in reversed(kind.__mro__):
        for name, hint in list(vars(base).get("__annotations__", {}).items()):
            if any(vars(base).get(name, None) is value for value in UNSAID):
                base.__annotations__[name] = Annotated[hint, tyro.conf.arg(help_behavior_hint="")]


def record_option(record: Named) -> tuple[Any, Any]:
    """Return the type and the default of a record's option: those of its main field, if it has one."""
    name = record.main_field
    return (get_type_hints(type(record))[name], getattr(record, name)) if name else (type(record), record)


@REGISTRY.struct_rule
def by_name(info: tyro.constructors.StructTypeInfo) -> tyro.constructors.StructConstructorSpec | None:
    """Give a tuple of named records, or of pairs of a name and a number, an option for each of its parts."""
    if are_pairs(info.default):
        parts = [(name, float, value) for name, value in info.default]
    elif are_named(info.default):
        parts = [(one.name, *record_option(one)) for one in info.default]
    else:
        return None

    def instantiate(**values: Any) -> tuple[Any, ...]:
        if are_pairs(info.default):
            return tuple(values.items())
        changed = zip(info.default, values.values(), strict=True)
        return tuple(replace(one, **{one.main_field: value}) if one.main_field else value for one, value in changed)

    return tyro.constructors.StructConstructorSpec(
        instantiate=instantiate,
        fields=tuple(tyro.constructors.StructFieldSpec(name, kind, value) for name, kind, value in parts),
    )


@REGISTRY.primitive_rule
def numbers(info: tyro.constructors.PrimitiveTypeInfo) -> tyro.constructors.PrimitiveConstructorSpec[Any] | None:
    """Read numbers, which are finite."""
    if info.type not in (int, float):
        return None
    read: Callable[[list[str]], Any] = whole_number if info.type is int else finite_number
    return tyro.constructors.PrimitiveConstructorSpec(
        nargs=1,
        metavar=info.type.__name__.upper(),
        instance_from_str=read,
        is_instance=lambda value: isinstance(value, (int, info.type)) and not isinstance(value, bool),
        str_from_instance=lambda value: [str(value)],
    )


def whole_number(words: list[str]) -> int:
    """Return the whole number that an option is given.

    Raises:
        ValueError: it is none.
    """
    try:
        return int(words[0])
    except ValueError:
        raise ValueError(f"'{words[0]}' is no whole number") from None


def finite_number(words: list[str]) -> float:
    """Return the number that an option is given.

    Raises:
        ValueError: it is none, or not finite.
    """
    try:
        value = float(words[0])
    except ValueError:
        raise ValueError(f"'{words[0]}' is no number") from None
    if not math.isfinite(value):
        raise ValueError(f"'{words[0]}' is not finite")
    return value


@REGISTRY.primitive_rule
def optional(info: tyro.constructors.PrimitiveTypeInfo) -> Any:
    """Name an option that may be left out by its type alone."""
    kinds = [one for one in get_args(info.type) if one is not NoneType]
    if info.type_origin not in (Union, UnionType) or len(kinds) != 1 or len(get_args(info.type)) != 2:
        return None
    inner = tyro.constructors.ConstructorRegistry.get_primitive_spec(
        tyro.constructors.PrimitiveTypeInfo.make(kinds[0], info.markers)
    )
    if not isinstance(inner, tyro.constructors.PrimitiveConstructorSpec) or inner.nargs == "*" or inner.choices:
        return None
    return replace(
        inner,
        instance_from_str=lambda words: None if words == ["None"] else inner.instance_from_str(words),
        is_instance=lambda value: value is None or inner.is_instance(value),
        str_from_instance=lambda value: ["None"] if value is None else inner.str_from_instance(value),
    )
