"""The catalogue: which motion is in which file, from which frame to which."""

import tomllib
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, get_args

from kine2go_warp.errors import CatalogueError
from kine2go_warp.files import sha256_of
from kine2go_warp.motions.clip import ClipOrigin, Kind
from kine2go_warp.motions.config import Mode, TimeScale
from kine2go_warp.motions.keypoints import FrameRange
from kine2go_warp.motions.parts import Part, parse_parts
from kine2go_warp.motions.sources import SOURCES, MotionSource, source_named, source_of
from kine2go_warp.motions.sources.dialects import Dialect, parse_dialects
from kine2go_warp.motions.sources.points import PointSource
from kine2go_warp.names import check_name
from kine2go_warp.toml import read_toml

CATALOGUE_FILE = Path(__file__).with_name("catalogue.toml")
BUNDLED_FOLDER = Path(__file__).with_name("data")


@dataclass(frozen=True)
class CatalogueEntry:
    """One motion of the catalogue, or a sequence of some."""

    name: str
    collection: str
    """Which of the catalogue's collections it belongs to, for licence and citation."""
    source: str
    """Name of the ``MotionSource`` that reads it."""
    file: str
    """Path within the folder of the source clips, or within the package if ``bundled``, or within ``folder``."""
    frames: FrameRange
    rate: float
    """Frames per second [Hz]; of a file that cannot tell its own, it is the file's. 0 if the file alone tells."""
    length: int
    """Rows of each trajectory in the paper's dataset."""
    sample: bool
    """Whether the paper's sample dataset holds it."""
    bundled: bool
    licence: str
    citation: str
    sha256: str = ""
    """Checksum of the file, empty where it is not known."""
    description: str = ""
    folder: str = ""
    """Where the file of a motion without a collection lies."""
    dialect: Dialect | None = None
    """Description of the source, where the catalogue itself has it."""
    scale: float = 0.0
    """Size of the Go2 over that of this animal, where it is another than its source's; else 0."""
    mode: str = ""
    """How it is retargeted, where that is another way than the settings'."""
    kind: Kind = "cycle"
    """Whether its clip is repeated, or played once between poses that are held."""
    time_scale: TimeScale | None = None
    """As in ``RetargetConfig``, where it is another than the settings'."""
    hold: float | None = None
    """Time for which these are held [s], where that is another than the settings'."""
    parts: tuple[Part, ...] = ()
    """What a sequence consists of; it has no file of its own, and is played once."""
    members: tuple["CatalogueEntry", ...] = ()
    """The motions of these."""
    mirrored: bool = False
    """Whether left and right are exchanged."""

    def twin(self) -> "CatalogueEntry":
        """Return the mirror image of the motion, a motion of its own."""
        return replace(self, name=twin_name(self.name), mirrored=True, sample=False)

    @property
    def motion_source(self) -> MotionSource:
        """The reader of this entry's file.

        Raises:
            CatalogueError: a scale is stated for a source that is a class.
        """
        source = source_named(self.source) if self.dialect is None else source_of(self.source, self.dialect)
        if self.scale == 0.0:
            return source
        if not isinstance(source, PointSource):
            raise CatalogueError(
                f"motion '{self.name}' states a scale, but the source {self.source} has one of its own"
            )
        return replace(source, scale=self.scale)

    def path(self, data_folder: Path | None) -> Path:
        """Return where the file lies, of a sequence that of its first part.

        Raises:
            CatalogueError: the motion is not bundled and no data folder is known.
        """
        if self.members:
            return next(iter([member.path(data_folder) for member in self.members]))
        if self.bundled:
            return BUNDLED_FOLDER / self.file
        if self.folder:
            return Path(self.folder) / self.file
        if data_folder is None:
            raise CatalogueError(
                f"motion '{self.name}' needs the file {self.file}: name the folder of the source clips with --data "
                "or in the environment variable KINE2GO_DATA"
            )
        return data_folder / self.file

    def is_there(self, data_folder: Path | None) -> bool:
        """Return whether the file is there, of a sequence all of them."""
        if self.members:
            return all(member.is_there(data_folder) for member in self.members)
        if not self.bundled and not self.folder and data_folder is None:
            return False
        return self.motion_source.data_file(self.path(data_folder)).is_file()

    def with_files(self) -> list["CatalogueEntry"]:
        """Return the motions that have files: itself, or of a sequence all that it is made of."""
        return [one for member in self.members for one in member.with_files()] or [self]

    def file_remarks(self, sha256: str) -> tuple[str, ...]:
        """Return what is to be said of a file by its checksum: whether it is another one than the catalogue means."""
        if not self.sha256 or sha256 == self.sha256:
            return ()
        return (f"{self.file} is not the catalogue's file (its checksum differs)",)

    def origin(self, path: Path, start: int, end: int, rate: float) -> ClipOrigin:
        """Return the record of where a clip comes from."""
        digest = sha256_of(self.motion_source.data_file(path))
        return ClipOrigin(self.source, self.file, digest, start, end, rate, self.licence, self.citation)


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
    found = parse_catalogue(read_toml(own, CatalogueError)[1], str(own), own.resolve().parent)
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
BOUNDS = (("rate", 1.0, 1000.0), ("scale", 1e-3, 1e3), ("hold", 0.0, 60.0), ("time_scale", 0.1, 10.0))
"""Fields that are numbers, with the least and the greatest."""
DEFAULT_LENGTH = 571
"""Rows of each trajectory of a motion that states none: 9.5 s, as most of the paper's."""


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
        if "parts" in motion:
            check_fields(motion, SEQUENCE_FIELDS, here)
            check_name(motion["name"], here, CatalogueError)
            if motion["name"] in entries:
                raise CatalogueError(f"{here}: a second motion '{motion['name']}'")
            entries[motion["name"]] = sequence_entry(motion, here)
            continue
        is_loose = "collection" not in motion and "source" in motion
        check_fields(motion, LOOSE_FIELDS if is_loose else MOTION_FIELDS, here)
        check_name(motion["name"], here, CatalogueError)
        if not is_loose and motion["collection"] not in collections:
            raise CatalogueError(f"{here}: there is no [collection.{motion['collection']}]")
        collection = {"folder": "", "rate": 0.0, **motion} if is_loose else collections[motion["collection"]]
        if is_loose and not collection["licence"].strip():
            raise CatalogueError(f"{here}: licence is empty; it goes with the data that are made of the motion")
        file = collection["folder"] + motion["file"]
        entry = CatalogueEntry(
            name=motion["name"],
            collection=motion.get("collection", ""),
            source=collection["source"],
            file=file,
            frames=FrameRange(motion.get("start", 0), motion.get("end", -1)),
            rate=motion.get("rate", collection["rate"]),
            length=motion.get("length", DEFAULT_LENGTH),
            sample=motion.get("sample", False),
            bundled=collection.get("bundled", False),
            licence=collection["licence"],
            citation=collection["citation"],
            sha256=content.get("sha256", {}).get(file.partition(":")[0], ""),
            description=motion.get("description", ""),
            folder=str(folder or Path.cwd()) if is_loose else "",
            dialect=dialects.get(collection["source"]),
            scale=motion.get("scale", 0.0),
            mode=motion.get("mode", ""),
            kind=motion.get("kind", "cycle"),
            hold=motion.get("hold"),
            time_scale=motion.get("time_scale"),
        )
        for one in [entry, entry.twin()] if motion.get("mirror") else [entry]:
            if one.name in entries:
                raise CatalogueError(f"{here}: a second motion '{one.name}'")
            entries[one.name] = one
    return entries


def twin_name(name: str) -> str:
    """Return the name of a motion's mirror image."""
    return f"{name}_mirrored"


def sequence_entry(motion: dict[str, Any], where: str) -> CatalogueEntry:
    """Return the entry of a sequence, without the motions of its parts.

    Raises:
        CatalogueError: its parts are not names, or tables of a motion and how often or for how long it is repeated.
    """
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
            wanted = "number or froude" if name == "time_scale" else fields[name].__name__
            raise CatalogueError(f"{where}: {name} is {value!r}, not a {wanted}")
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
