"""The catalogue: which motion is in which file, from which frame to which."""

import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from kine2go_warp.errors import CatalogueError
from kine2go_warp.files import sha256_of
from kine2go_warp.motions.clip import ClipOrigin
from kine2go_warp.motions.keypoints import FrameRange
from kine2go_warp.motions.sources import MotionSource, source_named
from kine2go_warp.names import check_name
from kine2go_warp.toml import read_toml

CATALOGUE_FILE = Path(__file__).with_name("catalogue.toml")
BUNDLED_FOLDER = Path(__file__).with_name("data")


@dataclass(frozen=True)
class CatalogueEntry:
    """One motion of the catalogue."""

    name: str
    collection: str
    """Which of the catalogue's collections it belongs to, for licence and citation."""
    source: str
    """Name of the ``MotionSource`` that reads it."""
    file: str
    """Path within the data folder, or within the package if ``bundled``."""
    frames: FrameRange
    rate: float
    """Frames per second [Hz]; of a file that cannot tell its own, it is the file's."""
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

    @property
    def motion_source(self) -> MotionSource:
        """The reader of this entry's file."""
        return source_named(self.source)

    def path(self, data_folder: Path | None) -> Path:
        """Return where the file lies.

        Raises:
            CatalogueError: the motion is not bundled and no data folder is known.
        """
        if self.bundled:
            return BUNDLED_FOLDER / self.file
        if data_folder is None:
            raise CatalogueError(
                f"motion '{self.name}' needs the file {self.file}: name the folder of the source clips with --data "
                "or in the environment variable KINE2GO_DATA"
            )
        return data_folder / self.file

    def is_there(self, data_folder: Path | None) -> bool:
        """Return whether the file is there."""
        if not self.bundled and data_folder is None:
            return False
        return self.motion_source.data_file(self.path(data_folder)).is_file()

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
    if own is None:
        return bundled_catalogue()
    return bundled_catalogue() | parse_catalogue(read_toml(own, CatalogueError)[1], str(own))


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
}
"""Fields and their types. All but those in ``OPTIONAL`` and a motion's own rate must be there."""
OPTIONAL = ("bundled", "start", "end", "length", "sample", "description")
DEFAULT_LENGTH = 571
"""Rows of each trajectory of a motion that states none: 9.5 s, as most of the paper's."""


def parse_catalogue(text: str, where: str) -> dict[str, CatalogueEntry]:
    """Return the entries of a catalogue by name.

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
    collections = content.get("collection", {})
    for line, (name, values) in zip(headers["[collection."], collections.items(), strict=False):
        check_fields(values, COLLECTION_FIELDS, f"{where}, line {line}, [collection.{name}]")
    entries: dict[str, CatalogueEntry] = {}
    for line, motion in zip(headers["[[motion]]"], content.get("motion", []), strict=False):
        here = f"{where}, line {line}, [[motion]]"
        check_fields(motion, MOTION_FIELDS, here)
        check_name(motion["name"], here, CatalogueError)
        if motion["collection"] not in collections:
            raise CatalogueError(f"{here}: there is no [collection.{motion['collection']}]")
        if motion["name"] in entries:
            raise CatalogueError(f"{here}: a second motion '{motion['name']}'")
        collection = collections[motion["collection"]]
        entries[motion["name"]] = CatalogueEntry(
            name=motion["name"],
            collection=motion["collection"],
            source=collection["source"],
            file=collection["folder"] + motion["file"],
            frames=FrameRange(motion.get("start", 0), motion.get("end", -1)),
            rate=motion.get("rate", collection["rate"]),
            length=motion.get("length", DEFAULT_LENGTH),
            sample=motion.get("sample", False),
            bundled=collection.get("bundled", False),
            licence=collection["licence"],
            citation=collection["citation"],
            sha256=content.get("sha256", {}).get(collection["folder"] + motion["file"].partition(":")[0], ""),
            description=motion.get("description", ""),
        )
    return entries


def check_fields(values: dict[str, object], fields: dict[str, type], where: str) -> None:
    """Check the fields of a table.

    Raises:
        CatalogueError: one is missing, unknown or of another type.
    """
    optional = (*OPTIONAL, "rate") if "collection" in fields else OPTIONAL
    missing = [name for name in fields if name not in values and name not in optional]
    unknown = [name for name in values if name not in fields]
    if missing or unknown:
        problem = f"lacks {', '.join(missing)}" if missing else f"has unknown {', '.join(unknown)}"
        raise CatalogueError(f"{where}: {problem}; the fields are {', '.join(fields)}")
    for name, value in values.items():
        kinds = (int, float) if fields[name] is float else (fields[name],)
        if not isinstance(value, kinds) or (isinstance(value, bool) and fields[name] is not bool):
            raise CatalogueError(f"{where}: {name} is {value!r}, not a {fields[name].__name__}")
    if isinstance(rate := values.get("rate", 1.0), int | float) and not 1.0 <= rate <= 1000.0:
        raise CatalogueError(f"{where}: rate is {rate:g}; choose 1 to 1000 Hz")


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
