"""What an engine is."""

from collections.abc import Sequence
from typing import Protocol

from kine2go_warp.pipelines.job import Job
from kine2go_warp.pipelines.worker import Outcome


class Engine(Protocol):
    """Runs stages of several motions at once. Use it as a context manager: it ends its workers."""

    name: str
    device: str
    """Where its workers simulate, such as ``cpu`` or ``cuda:0``."""

    def has_room(self) -> bool:
        """Return whether another motion can be started now."""
        ...

    def start(self, job: Job, stage: str) -> None:
        """Start the next stage of a motion, whose name is given, and return at once."""
        ...

    def wait(self, seconds: float) -> Sequence[Outcome]:
        """Return what has ended, after waiting for it a while at most."""
        ...

    def close(self) -> None:
        """End all workers at once."""
        ...
