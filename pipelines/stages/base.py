"""What a stage is."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from kine2go_warp.pipelines.artefacts import Artefact
from kine2go_warp.pipelines.job import Job, Monitor
from kine2go_warp.robots import DEFAULT_ROBOT

Inputs = Mapping[str, Artefact]
"""Finished artefacts of the earlier stages of a motion, by stage."""


def robot_inputs(job: Job) -> dict[str, Any]:
    """Return what a stage depends on of a robot other than the Go2; nothing for that, whose artefacts are older."""
    if job.recipe.robot == DEFAULT_ROBOT:
        return {}
    return {"robot": job.robot.reference, "robot_values": job.robot.training_values}


@dataclass(frozen=True)
class StageOutput:
    """What a stage has made."""

    output: str
    """Hash of the content."""
    metrics: dict[str, Any] = field(default_factory=dict)
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
