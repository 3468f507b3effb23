"""The catalogue: which motion is in which file, from which frame to which."""

import tomllib
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, get_args

from kine2go_warp.errors import CatalogueError
from kine2go_warp.motions.catalogue_entry import CatalogueEntry
from kine2go_warp.motions.clip import Kind
from kine2go_warp.motions.config import Mode
from kine2go_warp.motions.keypoints import RATES, FrameRange
from kine2go_warp.motions.parts import parse_parts
from kine2go_warp.motions.sources import SOURCES
from kine2go_warp.motions.sources.dialects import parse_dialects
from kine2go_warp.names import check_name
from kine2go_warp.toml import read_toml

CATALOGUE_FILE = Path(__file__).with_name("catalogue.toml")


@cache
def bundled_catalogue() -> dict[str, CatalogueEntry]:
    """Return the package's own entries by name.

    Raises:
        CatalogueError: the catalogue is damaged; the message names the line.
    """
    return parse_catalogue(CATALOGUE_FILE.read_text(encoding="utf-8"), CATALOGUE_FILE.name)


def load_catalogue(own: Path | None = None) -> dict[str, CatalogueEntry]:
    """Return all entries by name.

    Args:
        own: A user's own catalogue, whose entries come on top.

    Raises:
        CatalogueError: a catalogue is not there or damaged; the message names the line.
    """
    return bundled_catalogue() if own is None else bundled_catalogue() | own_catalogue(own)


def own_catalogue(own: Path) -> dict[str, CatalogueEntry]:
    """Return the entries of a user's own catalogue alone, by name; errors as of ``load_catalogue``."""
    values, text = read_toml(own, CatalogueError)
    found = parse_catalogue(text, str(own), own.resolve().parent)
    if not found and not {"source", "collection"} & values.keys():
        raise CatalogueError(f"{own}: holds no [[motion]] and no [source.NAME]; docs/your-own-motion.md has examples")
    known = bundled_catalogue() | found
    return {name: with_members(entry, known, str(own)) for name, entry in found.items()}


def with_members(
    entry: CatalogueEntry, entries: dict[str, CatalogueEntry], where: str, above: tuple[str, ...] = ()
) -> CatalogueEntry:
    """Return an entry with the motions of its parts, and their licences and citations.

    Raises:
        CatalogueError: a part is not in the catalogue, or a sequence is a part of itself.
    """
    members = []
    for part in entry.parts:
        if part.name in (*above, entry.name):
            raise CatalogueError(f"{where}: '{part.name}' is a part of itself, in the parts of '{entry.name}'")
        if part.name not in entries:
            raise CatalogueError(f"{where}: '{entry.name}' has the unknown part '{part.name}'; add a [[motion]] for it")
        members.append(with_members(entries[part.name], entries, where, (*above, entry.name)))
        if members[-1].kind == "once" and (part.cycles or part.seconds):
            raise CatalogueError(f"{where}: '{entry.name}' repeats '{part.name}', which is played once")
    if not members:
        return entry
    said = {name: "; ".join(dict.fromkeys(getattr(one, name) for one in members)) for name in ("licence", "citation")}
    return replace(entry, members=tuple(members), **said)


COLLECTION_FIELDS = {"source": str, "folder": str, "licence": str, "citation": str, "rate": float, "bundled": bool}
MOTION_FIELDS = {
    "name": str,
    "collection": str,
    "file": str,
    "start": int,
    "end": int,
    "length": int,
    "rate": float,
    "sample": bool,
    "description": str,
    "scale": float,
    "mode": str,
    "mirror": bool,
    "kind": str,
    "hold": float,
    "time_scale": float,
}
LOOSE_FIELDS = {**MOTION_FIELDS, "source": str, "licence": str, "citation": str}
del LOOSE_FIELDS["collection"]
"""Fields and their types: of a collection, of a motion in one, and of a motion whose file lies beside the catalogue.

All but those in ``OPTIONAL`` and a motion's own rate must be there.
"""
SEQUENCE_FIELDS = {"name": str, "parts": list, "length": int, "description": str, "hold": float}
"""Of a sequence of motions."""
OPTIONAL = ("bundled", "start", "end", "length", "sample", "description", "scale", "mode", "kind", "hold")
OPTIONAL += ("time_scale", "mirror")
KINDS = {str: "a text", int: "a whole number", float: "a number", bool: "true or false", list: "a list"}
BOUNDS = (("rate", *RATES), ("scale", 1e-3, 1e3), ("hold", 0.0, 60.0), ("time_scale", 0.1, 10.0))
"""Fields that are numbers, with the least and the greatest."""
DEFAULT_LENGTH = 571
"""Rows of each trajectory of a motion that states none, or is in no catalogue: 9.5 s, as most of the paper's."""


def parse_catalogue(text: str, where: str, folder: Path | None = None) -> dict[str, CatalogueEntry]:
    """Return the entries of a catalogue by name.

    Args:
        text: Of the file.
        where: Name of the file.
        folder: Where the file lies, for motions without a collection.

    Raises:
        CatalogueError: it is not TOML, or a field is missing, unknown or of another type; the message names the line.
    """
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise CatalogueError(f"{where}: not TOML ({error})") from None
    headers = {
        kind: [number for number, line in enumerate(text.splitlines(), 1) if line.strip().startswith(kind)]
        for kind in ("[collection.", "[[motion]]")
    }
    dialects = parse_dialects(content, text, where)
    if taken := sorted(set(dialects) & set(SOURCES)):
        raise CatalogueError(f"{where}: [source.{taken[0]}] is the name of a source of the package; choose another")
    collections = content.get("collection", {})
    for line, (name, values) in zip(headers["[collection."], collections.items(), strict=False):
        check_fields(values, COLLECTION_FIELDS, f"{where}, line {line}, [collection.{name}]")
    entries: dict[str, CatalogueEntry] = {}
    for line, motion in zip(headers["[[motion]]"], content.get("motion", []), strict=False):
        here = f"{where}, line {line}, [[motion]]"
        entry = sequence_entry(motion, here) if "parts" in motion else file_entry(motion, collections, folder, here)
        entry = replace(
            entry,
            sha256=content.get("sha256", {}).get(entry.file.partition(":")[0], ""),
            dialect=dialects.get(entry.source),
        )
        for one in [entry, entry.twin()] if motion.get("mirror") else [entry]:
            if one.name in entries:
                raise CatalogueError(f"{here}: a second motion '{one.name}'")
            entries[one.name] = one
    return entries


def file_entry(motion: dict[str, Any], collections: dict[str, Any], folder: Path | None, where: str) -> CatalogueEntry:
    """Return the entry of a motion that is in a file.

    Args:
        motion: Its table.
        collections: By name.
        folder: Where the file of a motion without a collection lies; by default in the working folder.
        where: The table, for messages.

    Raises:
        CatalogueError: a field is missing, unknown or wrong, or there is no such collection.
    """
    is_loose = "collection" not in motion and "source" in motion
    check_fields(motion, LOOSE_FIELDS if is_loose else MOTION_FIELDS, where)
    check_name(motion["name"], where, CatalogueError)
    if not is_loose and motion["collection"] not in collections:
        raise CatalogueError(f"{where}: there is no [collection.{motion['collection']}]")
    collection = {"folder": "", "rate": 0.0, **motion} if is_loose else collections[motion["collection"]]
    if is_loose and not collection["licence"].strip():
        raise CatalogueError(f"{where}: licence is empty; it goes with the data that are made of the motion")
    return CatalogueEntry(
        name=motion["name"],
        collection=motion.get("collection", ""),
        source=collection["source"],
        file=collection["folder"] + motion["file"],
        frames=FrameRange(motion.get("start", 0), motion.get("end", -1)),
        rate=motion.get("rate", collection["rate"]),
        length=motion.get("length", DEFAULT_LENGTH),
        sample=motion.get("sample", False),
        bundled=collection.get("bundled", False),
        licence=collection["licence"],
        citation=collection["citation"],
        description=motion.get("description", ""),
        folder=str(folder or Path.cwd()) if is_loose else "",
        scale=motion.get("scale", 0.0),
        mode=motion.get("mode", ""),
        kind=motion.get("kind", "cycle"),
        hold=motion.get("hold"),
        time_scale=motion.get("time_scale"),
    )


def sequence_entry(motion: dict[str, Any], where: str) -> CatalogueEntry:
    """Return the entry of a sequence, without the motions of its parts.

    Raises:
        CatalogueError: a field is missing, unknown or wrong; its parts are not names, or tables of a motion and how
            often or for how long it is repeated.
    """
    check_fields(motion, SEQUENCE_FIELDS, where)
    check_name(motion["name"], where, CatalogueError)
    parts = parse_parts(motion["parts"], where)
    return CatalogueEntry(
        name=motion["name"],
        collection="",
        source="sequence",
        file=" + ".join(part.name for part in parts),
        frames=FrameRange(),
        rate=0.0,
        length=motion.get("length", DEFAULT_LENGTH),
        sample=False,
        bundled=False,
        licence="",
        citation="",
        description=motion.get("description", ""),
        kind="once",
        hold=motion.get("hold"),
        parts=parts,
    )


def check_fields(values: dict[str, object], fields: dict[str, type], where: str) -> None:
    """Check the fields of a table.

    Raises:
        CatalogueError: one is missing, unknown or of another type.
    """
    optional = (*OPTIONAL, "rate") if "name" in fields else OPTIONAL
    missing = [name for name in fields if name not in values and name not in optional]
    unknown = [name for name in values if name not in fields]
    if missing or unknown:
        problem = f"lacks {', '.join(missing)}" if missing else f"has unknown {', '.join(unknown)}"
        raise CatalogueError(f"{where}: {problem}; the fields are {', '.join(fields)}")
    for name, value in values.items():
        if (name, value) == ("time_scale", "froude"):
            continue
        kinds = (int, float) if fields[name] is float else (fields[name],)
        if not isinstance(value, kinds) or (isinstance(value, bool) and fields[name] is not bool):
            wanted = "a number or froude" if name == "time_scale" else KINDS[fields[name]]
            raise CatalogueError(f"{where}: {name} is {value!r}, not {wanted}")
    for name, least, greatest in BOUNDS:
        if isinstance(number := values.get(name, 1.0), int | float) and not least <= number <= greatest:
            raise CatalogueError(f"{where}: {name} is {number:g}; choose {least:g} to {greatest:g}")
    for name, choices in (("mode", get_args(Mode)), ("kind", get_args(Kind))):
        if values.get(name, choices[0]) not in choices:
            raise CatalogueError(f"{where}: {name} is {values[name]!r}; choose {' or '.join(choices)}")
    if "hold" in values and values.get("kind") != "once" and "parts" not in values:
        raise CatalogueError(f'{where}: hold is for a motion with kind = "once"')


def motion_named(name: str, own: Path | None = None) -> CatalogueEntry:
    """Return one entry of the catalogue, or of a user's own.

    Raises:
        CatalogueError: there is none of that name; the message lists names that contain the same word.
    """
    entries = load_catalogue(own)
    if name in entries:
        return entries[name]
    words = name.lower().replace("-", "_").split("_")
    near = [known for known in entries if any(word in known.split("_") for word in words)] or list(entries)
    raise CatalogueError(f"unknown motion '{name}'; the catalogue has, for example: {', '.join(near[:8])}")
