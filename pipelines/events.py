"""Events of a run: for people, and as JSON for machines."""

from dataclasses import dataclass, field
from typing import Any, Literal

EventKind = Literal[
    "run_started",
    "stage_started",
    "progress",
    "stage_finished",
    "clip_assessed",
    "worker_died",
    "motion_finished",
    "motion_failed",
    "motion_stopped",
    "run_stopping",
    "run_finished",
]


@dataclass(frozen=True)
class Event:
    """One thing that has happened."""

    kind: EventKind
    motion: str = ""
    stage: str = ""
    detail: str = ""
    """In words: why a stage is run, how far it is, why it failed."""
    done: int = 0
    """Steps done, with ``progress``."""
    total: int = 0
    """Steps in all, with ``progress``; 0 if it is not known."""
    seconds: float = 0.0
    """Time that the stage or the run has taken [s]."""
    seconds_left: float | None = None
    """Estimate of the time to the end of the stage [s]."""
    metrics: dict[str, Any] = field(default_factory=dict)
    """Such as ``reward``, ``accepted`` or ``joint_rmse``."""


class RunObserver:
    """Receives the events of a run. This one ignores them; those of the command line show them."""

    def on_event(self, event: Event) -> None:
        """Take in an event."""
