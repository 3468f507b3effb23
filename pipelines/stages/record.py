"""Rollouts to a recording."""

from pathlib import Path
from typing import Any

from kine2go_warp.pipelines.artefacts import Artefact
from kine2go_warp.pipelines.job import Job, Monitor
from kine2go_warp.pipelines.stages.base import Done, Made
from kine2go_warp.pipelines.stages.score import verdicts_on


class RecordStage:
    """Makes ``MOTION.rrd``, and beside it the note by which 'kine2go review' knows that it is up to date."""

    name = "record"
    continues = False

    def is_wanted(self, job: Job) -> bool:
        """Return whether the recipe asks for it."""
        return job.recipe.record.trajectories > 0

    def inputs(self, job: Job, done: Done) -> dict[str, Any]:
        """Return the data's content, what people said of it, and how many trajectories are shown."""
        return {
            "version": 1,
            "data": done["gather"].record.output,
            "verdicts": verdicts_on(job),
            "trajectories": job.recipe.record.trajectories,
        }

    def make(self, job: Job, done: Done, folder: Path, monitor: Monitor) -> Made:
        """Record the most doubtful trajectories."""
        from kine2go_warp.dataset.motion import Motion
        from kine2go_warp.files import sha256_of
        from kine2go_warp.recordings.cache import RecordingCache
        from kine2go_warp.recordings.motion import Style

        del done
        cache = RecordingCache(folder, Style(job.recipe.record.trajectories))
        cached = cache.ensure(Motion(job.workspace.dataset, job.motion))
        monitor.advanced(1, 1, f"{cached.shown} trajectories")
        return Made(sha256_of(cached.path)[:32], {"shown": cached.shown})

    def show(self, job: Job, artefact: Artefact) -> None:
        """Link the recording and its note."""
        recording = job.workspace.recording(job.motion)
        for place in (recording, recording.with_suffix(".json")):
            job.workspace.show(place, artefact.path / place.name)
