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
    """Frames per second [Hz]."""
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

    def origin(self, path: Path, start: int, end: int, rate: float) -> ClipOrigin:
        """Return the record of where a clip comes from."""
        digest = sha256_of(self.motion_source.data_file(path))
        return ClipOrigin(self.source, self.file, digest, start, end, rate, self.licence, self.citation)


@cache
def load_catalogue() -> dict[str, CatalogueEntry]:
    """Return all entries by name."""
    with CATALOGUE_FILE.open("rb") as file:
        content = tomllib.load(file)
    entries = {}
    for motion in content["motion"]:
        collection = content["collection"][motion["collection"]]
        entries[motion["name"]] = CatalogueEntry(
            name=motion["name"],
            collection=motion["collection"],
            source=collection["source"],
            file=collection["folder"] + motion["file"],
            frames=FrameRange(motion["start"], motion["end"]),
            rate=motion.get("rate", collection["rate"]),
            length=motion["length"],
            sample=motion.get("sample", False),
            bundled=collection.get("bundled", False),
            licence=collection["licence"],
            citation=collection["citation"],
            sha256=content["sha256"].get(collection["folder"] + motion["file"].partition(":")[0], ""),
            description=motion.get("description", ""),
        )
    return entries


def motion_named(name: str) -> CatalogueEntry:
    """Return one entry.

    Raises:
        CatalogueError: there is none of that name; the message lists names that contain the same word.
    """
    entries = load_catalogue()
    if name in entries:
        return entries[name]
    words = name.lower().replace("-", "_").split("_")
    near = [known for known in entries if any(word in known.split("_") for word in words)] or list(entries)
    raise CatalogueError(f"unknown motion '{name}'; the catalogue has, for example: {', '.join(near[:8])}")
