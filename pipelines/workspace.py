"""The folder of a run: what lies where, who may write there, and how results are shown to people."""

import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from kine2go_warp.errors import PipelineError
from kine2go_warp.files import held, locked, moved_aside, temporary_sibling


@dataclass(frozen=True)
class Workspace:
    """Where the results of a run lie.

    ``artefacts`` holds all that was ever made; the rest shows what belongs to the recipe now: links into the artefacts,
    and the dataset, whose files are the artefacts' own wherever the file system can share them.
    """

    root: Path

    @property
    def artefacts(self) -> Path:
        """Results of all stages."""
        return self.root / "artefacts"

    @property
    def dataset(self) -> Path:
        """The Zarr store."""
        return self.root / "dataset.zarr"

    def scores(self, motion: str) -> Path:
        """The scores of a motion."""
        return self.root / "scores" / f"{motion}.json"

    @property
    def record(self) -> Path:
        """The resolved recipe, the software and the machine."""
        return self.root / "run.json"

    @property
    def stop_file(self) -> Path:
        """Present while the run is to end soon."""
        return self.root / "progress" / "stop"

    def clip(self, motion: str) -> Path:
        """The retargeted clip of a motion."""
        return self.root / "clips" / f"{motion}.npz"

    def policy(self, motion: str) -> Path:
        """The policy folder of a motion."""
        return self.root / "policies" / motion

    def recording(self, motion: str) -> Path:
        """The Rerun recording of a motion."""
        return self.root / "recordings" / f"{motion}.rrd"

    def log(self, motion: str) -> Path:
        """What happened to a motion."""
        return self.root / "logs" / f"{motion}.log"

    def progress(self, motion: str) -> Path:
        """How far the present stage of a motion is."""
        return self.root / "progress" / f"{motion}.json"

    def failure(self, motion: str) -> Path:
        """Why a motion failed, if it did."""
        return self.root / "progress" / f"{motion}.failed.json"

    def publish(self, link: Path, artefact: Path) -> None:
        """Let a link at ``link`` lead to a part of an artefact; a file of the user's own is set aside."""
        target = os.path.relpath(artefact, link.parent)
        if link.is_symlink() and os.readlink(link) == target:  # noqa: PTH115 - compared as text
            return
        link.parent.mkdir(parents=True, exist_ok=True)
        if link.exists() and not link.is_symlink():
            moved_aside(link, "older")
        temporary = temporary_sibling(link)
        temporary.unlink(missing_ok=True)
        temporary.symlink_to(target)
        temporary.replace(link)

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Keep other runs out of this folder.

        Raises:
            PipelineError: another run works here.
        """
        self.root.mkdir(parents=True, exist_ok=True)
        with held(self.root / ".lock") as holder:
            if holder:
                raise PipelineError(
                    f"{self.root}: another run works here ({holder}); wait for it, "
                    "look at it with 'kine2go status', or choose another folder with --out"
                )
            yield


class MotionLog:
    """The log of one motion, to which stages, runs and machines append."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def write(self, text: str) -> None:
        """Append a line with the time and the machine."""
        now = datetime.now(UTC).isoformat(timespec="seconds")
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("a", encoding="utf-8") as file:
                file.write(f"{now} {platform.node()} {text}\n")
        except OSError:
            # The reason of a failure, such as a full disk, matters more than its log.
            return


def is_locked(root: Path) -> bool:
    """Return whether a run works in a folder now."""
    try:
        with locked(root / ".lock", shared=True) as is_free:
            return not is_free
    except FileNotFoundError:
        return False
