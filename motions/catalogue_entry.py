"""One motion of a catalogue: where its file is, what reads it, how it is retargeted, whose it is."""

from dataclasses import dataclass, replace
from pathlib import Path

from kine2go_warp.errors import CatalogueError
from kine2go_warp.files import sha256_of
from kine2go_warp.motions.clip import ClipOrigin, Kind
from kine2go_warp.motions.config import TimeScale
from kine2go_warp.motions.keypoints import FrameRange
from kine2go_warp.motions.parts import Part
from kine2go_warp.motions.sources import MotionSource, source_named, source_of
from kine2go_warp.motions.sources.dialects import Dialect
from kine2go_warp.motions.sources.points import PointSource

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


def twin_name(name: str) -> str:
    """Return the name of a motion's mirror image."""
    return f"{name}_mirrored"
