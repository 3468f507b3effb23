"""An export that appears whole or not at all, and goes on where it was interrupted."""

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from kine2go_warp.errors import ExportError
from kine2go_warp.files import atomic_file, locked, put_in_place


class Journal:
    """What of an export is done already: motions, and the files that they are in."""

    def __init__(self, folder: Path, content: str) -> None:
        """Take up an interrupted export, or begin a new one where there is none of the same content.

        Args:
            folder: Where it lies until it is whole.
            content: What is exported how; another text stands for another export.
        """
        self.folder, self.data, self._content = folder, folder / "data", content
        self._file = folder / "progress.json"
        try:
            known = json.loads(self._file.read_text())
        except (OSError, ValueError):
            known = {}
        self.done: list[str] = known["done"] if known.get("content") == content else []
        files = set(known["files"]) if self.done else set()
        self.data.mkdir(parents=True, exist_ok=True)
        for path in self.data.rglob("*"):
            if path.is_file() and path.relative_to(self.data).as_posix() not in files:
                path.unlink()

    def add(self, name: str) -> None:
        """Note that a motion is written."""
        self.done.append(name)
        files = [path.relative_to(self.data).as_posix() for path in self.data.rglob("*") if path.is_file()]
        with atomic_file(self._file) as temporary:
            temporary.write_text(json.dumps({"content": self._content, "done": self.done, "files": files}))


@contextmanager
def resumable(out: Path, content: str) -> Iterator[Journal]:
    """Yield the journal of an export, whose folder takes the place of ``out`` if the block succeeds.

    After an interruption or a kill what is done stays beside ``out`` for the next export; an error removes it.

    Raises:
        ExportError: another process is exporting to the same folder.
    """
    folder = out.with_name(f".unfinished-{out.name}")
    folder.mkdir(parents=True, exist_ok=True)
    with locked(folder) as mine:
        if not mine:
            raise ExportError(f"{out}: another process is exporting to this folder")
        try:
            journal = Journal(folder, content)
            yield journal
            put_in_place(journal.data, out)
        except Exception:
            shutil.rmtree(folder, ignore_errors=True)
            raise
        shutil.rmtree(folder, ignore_errors=True)
