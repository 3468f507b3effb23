"""What lies beside a store while it is written, and what a killed process has left there."""

import json
import os
import platform
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kine2go_warp.files import flush_folder, is_running, locked


@dataclass(frozen=True)
class Leftover:
    """A folder beside a store."""

    folder: Path
    process: int
    """Number of the process that made it."""
    kind: str
    """``new``: a motion that is being written; ``old``: a whole motion that is being replaced; ``junk``: one that has
    been; ``spool``: rows on their way; ``root``: metadata of the store."""
    motion: str


class StagingArea:
    """Folders beside a store, on the same file system, which are renamed into it when they are whole."""

    def __init__(self, store: Path) -> None:
        self.store = store
        self._prefix = f".tmp-{store.name}-{platform.node()}-"

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Wait until no other process changes the store, and keep others waiting meanwhile."""
        self.store.parent.mkdir(parents=True, exist_ok=True)
        # The folder around the store itself is locked, so that no file is left behind.
        with locked(self.store.parent, wait=True):
            yield

    def folder(self, kind: str, motion: str = "") -> Path:
        """Return where this process may put something of a kind (``Leftover``)."""
        return self.store.with_name(f"{self._prefix}{os.getpid()}-{kind}-{motion}")

    def leftovers(self) -> Iterator[Leftover]:
        """Yield everything that processes of this machine have beside the store, this process included."""
        for path in sorted(self.store.parent.iterdir()) if self.store.parent.is_dir() else ():
            process, _, rest = path.name.removeprefix(self._prefix).partition("-")
            if path.name.startswith(self._prefix) and process.isdigit():
                kind, _, motion = rest.partition("-")
                yield Leftover(path, int(process), kind, motion)

    def put_in_place(self, motion: str) -> None:
        """Rename a finished motion into the store. After a kill between the renames ``recover`` finds the old one."""
        new, final = self.folder("new", motion), self.store / motion
        if not final.exists():
            new.rename(final)
            return
        old, junk = self.folder("old", motion), self.folder("junk", motion)
        try:
            final.rename(old)
            new.rename(final)
        finally:
            if not final.exists():
                old.rename(final)
        # Under another name before it loses its first file: what is called old is whole.
        old.rename(junk)
        shutil.rmtree(junk)

    def remove(self, motion: str) -> None:
        """Take a motion out of the store."""
        junk = self.folder("junk", motion)
        (self.store / motion).rename(junk)
        shutil.rmtree(junk)

    def root_metadata(self) -> dict[str, Any]:
        """Return what the root's file says, nothing if there is no store yet."""
        file = self.store / "zarr.json"
        return json.loads(file.read_text()) if file.exists() else {}

    def replace_root_metadata(self, metadata: dict[str, Any]) -> None:
        """Write the root's file beside the store and rename it into it; create the store if there is none."""
        folder = self.folder("root")
        shutil.rmtree(folder, ignore_errors=True)
        try:
            folder.mkdir(parents=True)
            (folder / "zarr.json").write_text(json.dumps(metadata, indent=2))
            flush_folder(folder)
            if self.store.exists():
                (folder / "zarr.json").replace(self.store / "zarr.json")
            else:
                folder.rename(self.store)
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def recover(self) -> bool:
        """Put back the motions that killed processes had set aside, and remove what else they left.

        Returns:
            Whether another process is at work beside the store.
        """
        others = False
        for one in self.leftovers():
            # In a container a process often has the number of the one that was killed.
            mine = one.process == os.getpid()
            if not mine and is_running(one.process):
                others = True
            elif one.kind == "old" and self.store.exists() and not (self.store / one.motion).exists():
                with suppress(FileNotFoundError):
                    one.folder.rename(self.store / one.motion)
            elif not mine or one.kind in ("old", "junk"):
                shutil.rmtree(one.folder, ignore_errors=True)
        return others
