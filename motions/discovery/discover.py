"""Discovering the motions in recordings: cut, labelled, without near duplicates, tried on the robot, the best first."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.errors import ClipError, Kine2GoError
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.motions.discovery.cuts import Cut, cuts
from kine2go_warp.motions.discovery.likeness import is_near, shape, unique_time
from kine2go_warp.motions.discovery.recording import Recording, read_recording
from kine2go_warp.motions.inverse_kinematics import InverseKinematics
from kine2go_warp.motions.keypoints import FrameRange
from kine2go_warp.motions.own_file import OwnFile
from kine2go_warp.motions.quality import ClipQuality, assess, clip_faults, clip_remarks
from kine2go_warp.motions.retarget import retarget

Array = NDArray[np.float64]
Advanced = Callable[[int, int, str], None]
"""Told of progress: steps done, all steps, what is worked on."""


@dataclass(frozen=True)
class Discovered:
    """One motion that was found."""

    name: str
    cut: Cut
    quality: ClipQuality | None = None
    """Of its clip, if it was retargeted."""

    @property
    def remarks(self) -> list[str]:
        """Return in what the clip is not as its animal."""
        return [] if self.quality is None else clip_remarks(self.quality)

    @property
    def rank(self) -> tuple[int, float]:
        """Return what motions are sorted by: remarks on the clip, then the seam."""
        return len(self.remarks), self.cut.seam


@dataclass(frozen=True)
class Discovery:
    """All that was found in some recordings."""

    recordings: tuple[Recording, ...]
    motions: tuple[Discovered, ...]
    """The best first."""
    duplicates: int
    """Motions that were left out as nearly the same as a better one."""
    refused: tuple[tuple[str, str], ...] = field(default=())
    """Names of motions that do not fit the robot, and why."""

    @property
    def recorded_time(self) -> float:
        """Of all recordings [s]."""
        return sum(one.duration for one in self.recordings)

    @property
    def unique_time(self) -> float:
        """How much of the recordings is no copy of another part [s]."""
        return unique_time(self.recordings)


def discover(
    files: Sequence[OwnFile],
    solver: InverseKinematics,
    advanced: Advanced,
    own: Path | None = None,
    is_checked: bool = True,
) -> Discovery:
    """Find the motions in some files.

    Args:
        files: The files, with their licence.
        solver: Of the robot.
        advanced: Told of progress.
        own: A catalogue whose sources are known besides the package's.
        is_checked: Whether each motion is retargeted, and left out if its clip has a fault.

    Raises:
        ClipError: a file is missing or damaged, or no source reads it; or it is named twice.
        CatalogueError: there is no such source, or no licence is stated.
    """
    for file in files:
        if len([one for one in files if one.path.resolve() == file.path.resolve()]) > 1:
            raise ClipError(f"{file.path} is named twice")
    recordings, found = [], []
    for index, file in enumerate(files):
        advanced(index, len(files), f"reading {file.path.name}")
        entry = file.entry(own)
        recording = read_recording(file, solver.spec, own)
        recordings.append(recording)
        found += [(one, entry) for one in cuts(recording)]
    kept: list[Discovered] = []
    shapes: list[Array] = []
    refused: list[tuple[str, str]] = []
    duplicates = 0
    for index, (one, file_entry) in enumerate(sorted(found, key=lambda pair: pair[0].seam)):
        advanced(index, len(found), f"{len(kept)} motions")
        form = shape(one)
        if any(is_near(one, other.cut, (form, known)) for other, known in zip(kept, shapes, strict=True)):
            duplicates += 1
            continue
        quality = None
        if is_checked:
            frames = FrameRange(one.start, one.end)
            entry = replace(file_entry, name=one.name, frames=frames, kind=one.clip_kind, time_scale=one.time_scale)
            try:
                quality = assess(retarget(entry, None, solver, RetargetConfig()), solver.spec)
                problem = "; ".join(clip_faults(quality))
            except Kine2GoError as error:
                problem = str(error)
            if problem:
                refused.append((one.name, problem))
                continue
        kept.append(Discovered(one.name, one, quality))
        shapes.append(form)
    kept.sort(key=lambda one: one.rank)
    return Discovery(tuple(recordings), tuple(kept), duplicates, tuple(refused))
