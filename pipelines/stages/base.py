"""What a stage is."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from kine2go_warp.pipelines.artefacts import Artefact
from kine2go_warp.pipelines.job import Job, Monitor

Inputs = Mapping[str, Artefact]
"""Finished artefacts of the earlier stages of a motion, by stage."""


@dataclass(frozen=True)
class StageOutput:
    """What a stage has made."""

    output: str
    """Hash of the content."""
    figures: dict[str, Any] = field(default_factory=dict)
    """What people want to know of it."""


class Stage(Protocol):
    """One step from inputs to an artefact. It depends on nothing but its inputs."""

    name: str
    resumable: bool
    """Whether an interrupted attempt is continued, rather than begun anew."""

    def enabled(self, job: Job) -> bool:
        """Return whether the recipe asks for it."""
        ...

    def inputs(self, job: Job, upstream: Inputs) -> dict[str, Any]:
        """Return all that decides what the stage makes, as JSON values.

        ``version`` among them is raised by whoever changes the code such that the same inputs give something else.
        """
        ...

    def make(self, job: Job, upstream: Inputs, folder: Path, monitor: Monitor) -> StageOutput:
        """Make the artefact in a folder."""
        ...

    def publish(self, job: Job, artefact: Artefact) -> None:
        """Show the artefact in the workspace, where people look for it."""
        ...
