"""Results of stages, kept under the hash of what they were made from and never changed afterwards.

An artefact is a folder, ``artefacts/STAGE/MOTION-KEY``. It is made under another name in the same place and renamed
when it is whole, so that it exists entirely or not at all. Work that takes hours may be continued in its unfinished
folder; all other work begins there anew.
"""

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from kine2go_warp.errors import PipelineError
from kine2go_warp.files import atomic_file, flush_folder, locked, moved_aside
from kine2go_warp.settings import content_hash, from_dictionary

RECORD = "artefact.json"
LOCK = "lock"
FORMAT_VERSION = 1
FORMER_NAMES = {"figures": "metrics"}
"""Fields of ``artefact.json`` under the names that older runs gave them."""


@dataclass(frozen=True)
class ArtefactRecord:
    """What ``artefact.json`` says of an artefact."""

    stage: str
    motion: str
    inputs: dict[str, Any]
    """Everything that decides what the artefact holds; its hash is the key."""
    output: str
    """Hash of what it holds, which is what later stages depend on."""
    metrics: dict[str, Any]
    """What people want to know of it."""
    seconds: float
    """Time that it took [s]; interrupted attempts count only where they were continued."""
    finished: str
    """Date and time, ISO 8601 with the time zone."""
    software: str
    """Version and revision of this package."""
    machine: str
    """Name of the machine and device."""
    core_seconds: float = 0.0
    """Processor time that it took, that of child processes included [s]; 0 in records made before it was kept."""
    format_version: int = FORMAT_VERSION

    @property
    def key(self) -> str:
        """Hash of the inputs."""
        return content_hash(self.inputs)


@dataclass(frozen=True)
class Artefact:
    """A finished artefact."""

    path: Path
    record: ArtefactRecord = field(repr=False)


@dataclass(frozen=True)
class ArtefactSlot:
    """Where an artefact of certain inputs lies, or will lie."""

    folder: Path
    """Folder of the stage."""
    stage: str
    motion: str
    inputs: dict[str, Any] = field(repr=False)

    @property
    def key(self) -> str:
        """Hash of the inputs."""
        return content_hash(self.inputs)

    @property
    def path(self) -> Path:
        """The finished artefact."""
        return self.folder / f"{self.motion}-{self.key}"

    @property
    def work(self) -> Path:
        """The unfinished artefact."""
        return self.folder / f".work-{self.motion}-{self.key}"

    def get(self) -> Artefact | None:
        """Return the artefact if it is there. One whose record cannot be read is set aside and counts as missing."""
        if not self.path.is_dir():
            return None
        record = read_record(self.path / RECORD)
        if record is None or record.key != self.key:
            moved_aside(self.path, "damaged")
            return None
        return Artefact(self.path, record)

    @contextmanager
    def build(self, keep: bool) -> Iterator[Path]:
        """Yield the folder of the unfinished artefact, which no other process may work in meanwhile.

        Args:
            keep: Continue what an earlier attempt has left there, instead of beginning anew.

        Raises:
            PipelineError: another process works in it.
        """
        self.work.mkdir(parents=True, exist_ok=True)
        # Beside the folder, so that the lock is no part of the artefact.
        lock = self.work.with_name(f"{self.work.name}.{LOCK}")
        with locked(lock) as is_ours:
            if not is_ours:
                raise PipelineError(f"{self.work}: another process works here; wait for it or end it")
            if not keep:
                shutil.rmtree(self.work)
                self.work.mkdir()
            yield self.work
        lock.unlink(missing_ok=True)

    def finish(self, record: ArtefactRecord) -> Artefact:
        """Make the unfinished artefact a finished one."""
        with atomic_file(self.work / RECORD) as temporary:
            temporary.write_text(json.dumps(asdict(record), indent=2) + "\n")
        flush_folder(self.work)
        if self.path.exists():
            moved_aside(self.path, "damaged")
        self.work.rename(self.path)
        return Artefact(self.path, record)


def latest(folder: Path, motion: str) -> ArtefactRecord | None:
    """Return the record of a motion's newest artefact of a stage, whatever its inputs."""
    paths = folder.glob(f"{motion}-{'[0-9a-f]' * 16}/{RECORD}")
    records = [record for path in paths if (record := read_record(path)) is not None]
    return max(records, key=lambda record: record.finished, default=None)


def read_record(path: Path) -> ArtefactRecord | None:
    """Return a record, none if there is none or it cannot be read."""
    try:
        values: dict[str, Any] = json.loads(path.read_text())
        values = {FORMER_NAMES.get(name, name): value for name, value in values.items()}
        record = from_dictionary(ArtefactRecord, values, str(path), PipelineError)
    except (OSError, ValueError, AttributeError, PipelineError):
        return None
    return record if record.format_version == FORMAT_VERSION else None


def difference(before: dict[str, Any], after: dict[str, Any], path: str = "") -> list[str]:
    """Return in words what differs between the inputs of two artefacts, such as ``settings.seed 1 -> 2``."""
    found = []
    for name in sorted({*before, *after}):
        old, new = before.get(name), after.get(name)
        where = f"{path}{name}"
        if isinstance(old, dict) and isinstance(new, dict):
            found += difference(old, new, f"{where}.")
        elif old != new:
            found.append(f"{where} {shown(old)} -> {shown(new)}")
    return found


def shown(value: Any) -> str:
    """Return a value in few characters."""
    text = json.dumps(value)
    return text if len(text) <= 24 else f"{text[:20]}..."
