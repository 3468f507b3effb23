"""What a stage is given, and what it tells while it works. All of it can be sent to another process."""

import json
import math
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from kine2go_warp.files import atomic_file
from kine2go_warp.motions.catalogue import motion_named
from kine2go_warp.motions.catalogue_entry import CatalogueEntry
from kine2go_warp.pipelines.recipe import Recipe
from kine2go_warp.pipelines.workspace import MotionLog, Workspace
from kine2go_warp.robots import RobotSpec, robot_named

PROGRESS_INTERVAL = 0.5
"""Least time between two notes of one stage [s]."""


class StageStopped(KeyboardInterrupt):
    """A stage has stopped because the run is to end; it begins anew next time."""


@dataclass(frozen=True)
class Job:
    """One motion of a recipe, and where it is worked on."""

    motion: str
    recipe: Recipe
    workspace: Workspace
    data_folder: Path | None
    device: str
    """Such as ``cpu`` or ``cuda:0``, as the worker sees it."""
    processes: int = 1
    """Processes that may share one simulation on a CPU."""

    @property
    def entry(self) -> CatalogueEntry:
        """The motion in the catalogue."""
        return motion_named(self.motion, self.recipe.own_catalogue)

    @property
    def robot(self) -> RobotSpec:
        """The robot of the recipe."""
        return robot_named(self.recipe.robot)


@dataclass(frozen=True)
class ProgressNote:
    """How far a stage has come."""

    stage: str
    done: int
    total: int
    """Steps in all, 0 while it is not known."""
    detail: str
    """In words."""
    started: float
    """When the stage began [s since 1970]; shown to people only."""
    seconds: float
    """Time since then, by a clock that nobody sets [s]."""
    seconds_left: float | None = None
    """Estimate of the time to the end of the stage [s], none where nothing is known."""
    metrics: dict[str, float] = field(default_factory=dict)
    """Such as ``reward`` or ``accepted``."""


class Monitor:
    """Through it a stage tells how far it is and learns whether to stop. Both go through files of the workspace.

    So it is all the same whether the stage works in this process, in another, or on another machine.
    """

    def __init__(self, job: Job, stage: str) -> None:
        self._file = job.workspace.progress(job.motion)
        self._stop_file = job.workspace.stop_file
        self._log = MotionLog(job.workspace.log(job.motion))
        self._stage = stage
        self._began, self._began_wall = time.monotonic(), time.time()
        self._last = float("-inf")
        self._first: tuple[float, int] | None = None
        """When the first steps were done, and how many. Before, kernels are compiled and steps of an earlier run are
        counted, so that the speed from there on is that of the rest."""
        self.advanced(0, 0, "")

    def advanced(self, done: int, total: int, detail: str, **metrics: float) -> None:
        """Note how far the stage is; only now and then, and at the end, is it written."""
        now = time.monotonic()
        if done > 0 and self._first is None:
            self._first = (now, done)
        if done != total and now - self._last < PROGRESS_INTERVAL:
            return
        self._last = now
        metrics = {name: value for name, value in metrics.items() if math.isfinite(value)}
        left = self._seconds_left(now, done, total)
        note = ProgressNote(self._stage, done, total, detail, self._began_wall, now - self._began, left, metrics)
        with atomic_file(self._file) as temporary:
            temporary.write_text(json.dumps(asdict(note)))

    def _seconds_left(self, now: float, done: int, total: int) -> float | None:
        """Return how long the rest takes at the speed since the first step [s], none where that is not known."""
        if self._first is None or done <= self._first[1] or done > total:
            return None
        began, before = self._first
        return (now - began) * (total - done) / (done - before)

    def note(self, text: str) -> None:
        """Write a line into the log of the motion."""
        self._log.write(f"{self._stage}: {text}")

    def should_stop(self) -> bool:
        """Return whether the run is to end after the present step."""
        return self._stop_file.exists()

    def stop_if_asked(self) -> None:
        """End the stage if the run is to end, for stages that cannot be continued.

        Raises:
            StageStopped: the run is to end.
        """
        if self.should_stop():
            raise StageStopped("the run was asked to end")


def read_progress(path: Path) -> ProgressNote | None:
    """Return what a stage has noted last, none if there is nothing or it cannot be read."""
    try:
        values: dict[str, Any] = json.loads(path.read_text())
        return ProgressNote(**values)
    except (OSError, ValueError, TypeError):
        return None
