"""Stages in this process, one after the other: for debugging."""

from collections.abc import Sequence

from kine2go_warp.pipelines.job import Job
from kine2go_warp.pipelines.worker import Outcome, run_next_stage


class InlineEngine:
    """Runs a stage when it is waited for."""

    name = "inline"

    def __init__(self, device: str) -> None:
        self.device = device
        self._job: Job | None = None

    def has_room(self) -> bool:
        """Return whether nothing is waiting to be run."""
        return self._job is None

    def start(self, job: Job, stage: str) -> None:
        """Keep the motion until ``wait``."""
        del stage
        self._job = job

    def wait(self, seconds: float) -> Sequence[Outcome]:
        """Run the stage to its end, however long it takes."""
        del seconds
        job, self._job = self._job, None
        return [run_next_stage(job)] if job is not None else []

    def close(self) -> None:
        """Nothing is left to end."""
