"""Takes the motions of a recipe through all stages, several at once, and starts only what is missing."""

import json
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from kine2go_warp.errors import Kine2GoError, explain
from kine2go_warp.files import atomic_file
from kine2go_warp.machine import machine
from kine2go_warp.pipelines.engines.base import Engine
from kine2go_warp.pipelines.events import Event, EventKind, RunObserver
from kine2go_warp.pipelines.job import Job, ProgressNote, read_progress
from kine2go_warp.pipelines.plan import StagePlan, plan
from kine2go_warp.pipelines.recipe import Recipe
from kine2go_warp.pipelines.worker import Outcome
from kine2go_warp.pipelines.workspace import MotionLog, Workspace
from kine2go_warp.revision import revision
from kine2go_warp.settings import to_dictionary

POLL = 0.5
"""Interval between two looks at the progress of the stages [s]."""
ATTEMPTS = 3
"""How often a stage is started whose worker dies."""


@dataclass(frozen=True)
class Failure:
    """Why a motion has no complete results."""

    stage: str
    why: str
    log: Path


@dataclass(frozen=True)
class RunResult:
    """What became of a run's motions, each by name."""

    finished: tuple[str, ...]
    failed: dict[str, Failure]
    stopped: tuple[str, ...]
    """Those that the run left unfinished because it was asked to end."""


def make_jobs(recipe: Recipe, workspace: Workspace, data_folder: Path | None, device: str) -> list[Job]:
    """Return a job for each motion of a recipe.

    Raises:
        CatalogueError: a motion is not in the catalogue, or needs a data folder and there is none.
    """
    root = Workspace(workspace.root.absolute())
    folder = data_folder.absolute() if data_folder is not None else None
    jobs = [Job(motion, recipe, root, folder, device) for motion in dict.fromkeys(recipe.motions)]
    for job in jobs:
        job.entry.path(folder)
    return jobs


class RecipeRunner:
    """Runs one recipe in one workspace."""

    def __init__(
        self,
        recipe: Recipe,
        workspace: Workspace,
        data_folder: Path | None,
        engine: Engine,
        observer: RunObserver | None = None,
        should_stop: Callable[[], bool] = lambda: False,
    ) -> None:
        """Check that every motion is known, before anything is written.

        Args:
            recipe: What to do.
            workspace: Where.
            data_folder: Folder of the source clips.
            engine: Runs the stages; it is closed at the end of ``run``.
            observer: Receives the events.
            should_stop: Looked at now and then; once true, trainings write a checkpoint and the run ends.

        Raises:
            CatalogueError: a motion is not in the catalogue, or needs a data folder and there is none.
        """
        self.recipe, self.engine, self.observer = recipe, engine, observer or RunObserver()
        self.jobs = {job.motion: job for job in make_jobs(recipe, workspace, data_folder, engine.device)}
        self.workspace = Workspace(workspace.root.absolute())
        self._should_stop = should_stop
        self._queue = deque(self.jobs)
        self._running: dict[str, tuple[str, ProgressNote | None]] = {}
        self._deaths: dict[tuple[str, str], int] = {}
        self._assessed: set[str] = set()
        self._finished: list[str] = []
        self._failed: dict[str, Failure] = {}
        self._stopped: list[str] = []

    def run(self) -> RunResult:
        """Take every motion through all stages. A motion that fails does not stop the others.

        Raises:
            PipelineError: another run works in the same folder.
        """
        started = time.monotonic()
        with self.workspace.alone():
            try:
                self._begin()
                while self._queue or self._running:
                    self._step()
            finally:
                self.engine.close()
                self.workspace.stop_file.unlink(missing_ok=True)
        result = RunResult(tuple(self._finished), dict(self._failed), tuple(self._stopped))
        counts = {"finished": len(result.finished), "failed": len(result.failed), "stopped": len(result.stopped)}
        self._emit("run_finished", seconds=time.monotonic() - started, metrics=counts)
        return result

    def _begin(self) -> None:
        """Write down what is run, and clear what an earlier run has left."""
        self.workspace.stop_file.parent.mkdir(parents=True, exist_ok=True)
        self.workspace.stop_file.unlink(missing_ok=True)
        record = {
            "recipe": to_dictionary(self.recipe),
            "engine": self.engine.name,
            "software_revision": revision(),
            # Of a cluster, this is the machine that leads; artefacts name the ones that made them.
            "machine": machine("cpu" if self.engine.name == "ray" else self.engine.device),
        }
        with atomic_file(self.workspace.record) as temporary:
            temporary.write_text(json.dumps(record, indent=2) + "\n")
        for motion in self.jobs:
            self.workspace.progress(motion).unlink(missing_ok=True)
        self._emit("run_started", detail=self.recipe.name, metrics={"motions": len(self.jobs)})

    def _step(self) -> None:
        """Start what can be started, and take in what has ended."""
        if self._should_stop() and not self.workspace.stop_file.exists():
            self.workspace.stop_file.touch()
            self._emit("run_stopping")
            while self._queue:
                self._stop(self._queue.popleft(), "")
        while self._queue and self.engine.has_room():
            self._start(self._queue.popleft())
        for outcome in self.engine.wait(POLL):
            self._settle(outcome)
        self._pass_on_progress()

    def _start(self, motion: str) -> None:
        """Show what is done of a motion and start its next stage, if there is one."""
        job, stage, done = self.jobs[motion], "", []
        try:
            for one in plan(job):
                stage = one.stage.name
                if one.state == "next":
                    self._emit("stage_started", motion, stage, one.why)
                    self._running[motion] = (stage, None)
                    self.engine.start(job, stage)
                    return
                if one.artefact is not None:
                    done.append(one)
                    remarks = one.artefact.record.metrics.get("clip_remarks", ())
                    if remarks and motion not in self._assessed:
                        self._assessed.add(motion)
                        self._emit("clip_assessed", motion, stage, "; ".join(remarks))
                    one.stage.publish(job, one.artefact)
        except Kine2GoError as error:
            self._fail(motion, stage or "retarget", str(error))
        except OSError as error:
            self._fail(motion, stage or "retarget", explain(error))
        else:
            self._finish(motion, done)

    def _settle(self, outcome: Outcome) -> None:
        """Decide how a motion goes on."""
        motion, stage = outcome.motion, outcome.stage
        del self._running[motion]
        self.workspace.progress(motion).unlink(missing_ok=True)
        if outcome.state == "failed":
            doubt = "; the clip itself is doubtful, see 'kine2go status'" if motion in self._assessed else ""
            self._fail(motion, stage, outcome.why + doubt)
        elif outcome.state == "stopped" or self.workspace.stop_file.exists():
            self._stop(motion, stage)
        elif outcome.state == "done":
            self._emit("stage_finished", motion, stage, seconds=outcome.seconds)
            # In front, so that one motion is complete before the next begins.
            self._queue.appendleft(motion)
        else:
            self._try_again(motion, stage, outcome.why)

    def _try_again(self, motion: str, stage: str, why: str) -> None:
        """Start a stage again whose worker has died, unless it kills every worker."""
        deaths = self._deaths[motion, stage] = self._deaths.get((motion, stage), 0) + 1
        MotionLog(self.workspace.log(motion)).write(f"{stage}: {why}; death {deaths}")
        self._emit("worker_died", motion, stage, why)
        if deaths < ATTEMPTS:
            self._queue.appendleft(motion)
        else:
            self._fail(motion, stage, f"its worker died {deaths} times, last: {why}")

    def _fail(self, motion: str, stage: str, why: str) -> None:
        """Note why a motion failed."""
        failure = Failure(stage, why, self.workspace.log(motion))
        self._failed[motion] = failure
        MotionLog(failure.log).write(f"{stage} failed for good: {why}")
        with atomic_file(self.workspace.failure(motion)) as temporary:
            temporary.write_text(json.dumps({"stage": stage, "why": why, "log": str(failure.log)}) + "\n")
        self._emit("motion_failed", motion, stage, f"{why} (log: {failure.log})")

    def _stop(self, motion: str, stage: str) -> None:
        """Leave a motion unfinished."""
        self._stopped.append(motion)
        self._emit("motion_stopped", motion, stage)

    def _finish(self, motion: str, done: list[StagePlan]) -> None:
        """Note that all stages of a motion are done."""
        self._finished.append(motion)
        self.workspace.failure(motion).unlink(missing_ok=True)
        metrics = {name: value for one in done if one.artefact for name, value in one.artefact.record.metrics.items()}
        self._emit("motion_finished", motion, metrics=metrics)

    def _pass_on_progress(self) -> None:
        """Tell how far the stages are that have come farther."""
        for motion, (stage, known) in self._running.items():
            note = read_progress(self.workspace.progress(motion))
            if note is None or note.stage != stage or note == known:
                continue
            self._running[motion] = (stage, note)
            self.observer.on_event(
                Event(
                    "progress",
                    motion,
                    stage,
                    note.detail,
                    note.done,
                    note.total,
                    note.seconds,
                    note.seconds_left,
                    note.metrics,
                )
            )

    def _emit(self, kind: EventKind, motion: str = "", stage: str = "", detail: str = "", **rest: object) -> None:
        """Send an event to the observer."""
        self.observer.on_event(replace(Event(kind, motion, stage, detail), **rest))  # pyright: ignore[reportArgumentType]
