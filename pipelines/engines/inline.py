"""Stages in this process, one after the other: for debugging."""

from collections.abc import Sequence

from kine2go_warp.pipelines.job import Job
from kine2go_warp.pipelines.worker import Outcome, run_stage


class InlineEngine:
    """Runs a stage when it is waited for."""

    name = "inline"

    def __init__(self, device: str) -> None:
        self.device = device
        self._task: tuple[Job, str] | None = None

    def has_room(self) -> bool:
        """Return whether nothing is waiting to be run."""
        return self._task is None

    def start(self, job: Job, stage: str) -> None:
        """Keep the motion until ``wait``."""
        self._task = job, stage

    def wait(self, seconds: float) -> Sequence[Outcome]:
        """Run the stage to its end, however long it takes."""
        del seconds
        task, self._task = self._task, None
        return [run_stage(*task)] if task is not None else []

    def close(self) -> None:
        """Nothing is left to end."""
