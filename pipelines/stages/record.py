"""Rollouts to a recording."""

import importlib.util
from pathlib import Path
from typing import Any

from kine2go_warp.pipelines.artefacts import Artefact
from kine2go_warp.pipelines.job import Job, Monitor
from kine2go_warp.pipelines.stages.base import Inputs, StageOutput
from kine2go_warp.pipelines.stages.score import reviews_on


def can_record() -> bool:
    """Return whether Rerun is installed: a machine that trains may do without it."""
    return importlib.util.find_spec("rerun") is not None


class RecordStage:
    """Makes ``MOTION.rrd``, and beside it the note by which 'kine2go dataset review' knows that it is up to date."""

    name = "record"
    resumable = False

    def enabled(self, job: Job) -> bool:
        """Return whether the recipe asks for it and Rerun is installed."""
        return job.recipe.record.trajectories > 0 and can_record()

    def inputs(self, job: Job, upstream: Inputs) -> dict[str, Any]:
        """Return the data's content, what people said of it, and how many trajectories are shown."""
        return {
            "version": 1,
            "data": upstream["gather"].record.output,
            "verdicts": reviews_on(job),
            "trajectories": job.recipe.record.trajectories,
        }

    def make(self, job: Job, upstream: Inputs, folder: Path, monitor: Monitor) -> StageOutput:
        """Record the trajectories closest to a limit."""
        from kine2go_warp.dataset.motion import Motion
        from kine2go_warp.files import sha256_of
        from kine2go_warp.recordings.cache import RecordingCache
        from kine2go_warp.recordings.motion import Style

        del upstream
        cache = RecordingCache(folder, Style(job.recipe.record.trajectories))
        cached = cache.ensure(Motion(job.workspace.dataset, job.motion))
        monitor.advanced(1, 1, f"{cached.shown} trajectories")
        return StageOutput(sha256_of(cached.path)[:32], {"shown": cached.shown})

    def publish(self, job: Job, artefact: Artefact) -> None:
        """Link the recording and its note."""
        recording = job.workspace.recording(job.motion)
        for path in (recording, recording.with_suffix(".json")):
            job.workspace.publish(path, artefact.path / path.name)
