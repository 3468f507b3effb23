"""A folder of recordings, each made again only when what it shows has changed."""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import rerun as rr

from kine2go_warp import __version__
from kine2go_warp.dataset.content import motion_content
from kine2go_warp.dataset.motion import Motion
from kine2go_warp.dataset.reviews import read_reviews
from kine2go_warp.errors import RecordingError
from kine2go_warp.files import atomic_file, sha256_of
from kine2go_warp.recordings.meshes import Meshes
from kine2go_warp.recordings.motion import Style, record_motion
from kine2go_warp.settings import content_hash


@dataclass(frozen=True)
class CachedRecording:
    """One recording of a folder."""

    path: Path
    shown: int
    """Trajectories that it shows."""
    is_new: bool
    """Whether it was written now."""


class RecordingCache:
    """The recordings of a folder. Beside each lies a note, ``MOTION.json``, of what it shows."""

    def __init__(self, folder: Path, style: Style, overwrite: bool = False) -> None:
        """Look at a folder; it need not exist.

        Args:
            folder: Of the recordings.
            style: What they show.
            overwrite: Replace files that have no note.

        Raises:
            RecordingError: there is a file in place of the folder.
        """
        if folder.exists() and not folder.is_dir():
            raise RecordingError(f"{folder}: is a file; name a folder for the recordings")
        self.folder, self.style, self.overwrite = folder, style, overwrite

    def path(self, motion: str) -> Path:
        """Return where the recording of a motion lies."""
        return self.folder / f"{motion}.rrd"

    def ensure(self, motion: Motion, on_write: Callable[[], None] | None = None) -> CachedRecording:
        """Write the recording of a motion, unless it is there and shows the same.

        Args:
            motion: The motion.
            on_write: Called before it is written.

        Raises:
            DatasetError: the motion cannot be read, or holds no trajectory.
            RecordingError: a file without a note is in the way.
        """
        path, content = self.path(motion.name), self.content(motion)
        note = path.with_suffix(".json")
        known = read_note(note)
        if known.get("content") == content and self._is_enough(known) and is_whole(path, known):
            return CachedRecording(path, known["shown"], is_new=False)
        if path.exists() and not note.is_file() and not self.overwrite:
            raise RecordingError(f"{path}: exists and was not made from a dataset; choose another folder with --out, "
                                 "or replace it with --overwrite")  # fmt: skip
        if on_write is not None:
            on_write()
        note.unlink(missing_ok=True)
        shown = record_motion(motion, path, self.style)
        with atomic_file(note) as temporary:
            values = {"content": content, "trajectories": self.style.trajectories, "shown": shown}
            temporary.write_text(json.dumps({**values, "rerun": rr.__version__, "sha256": sha256_of(path)}) + "\n")
        return CachedRecording(path, shown, is_new=True)

    def content(self, motion: Motion) -> str:
        """Return a hash of all that a recording is made from, but for the number of trajectories."""
        reviews = [asdict(one) for one in read_reviews(motion.path) if one.motion == motion.name]
        meshes = (self.style.meshes or Meshes.of(motion.robot)).content()
        return content_hash(__version__, motion_content(motion.path, motion.name), reviews, meshes, self.style.by)

    def _is_enough(self, known: dict[str, Any]) -> bool:
        """Return whether a recording shows as many trajectories as are wanted."""
        limit, wanted = known.get("trajectories"), self.style.trajectories
        return limit is None or (wanted is not None and limit >= wanted)


def is_whole(path: Path, known: dict[str, Any]) -> bool:
    """Return whether a file is the one that was noted, written by this version of Rerun, which reads no other."""
    return path.is_file() and known.get("rerun") == rr.__version__ and known.get("sha256") == sha256_of(path)


def read_note(path: Path) -> dict[str, Any]:
    """Return what is noted of a recording, empty if that cannot be read."""
    try:
        note = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return note if isinstance(note, dict) and isinstance(note.get("shown"), int) else {}
