"""Which stages of a motion are done, which one comes next, and why."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from kine2go_warp.pipelines.artefacts import Artefact, ArtefactSlot, difference, latest
from kine2go_warp.pipelines.job import Job
from kine2go_warp.pipelines.stages import STAGES, Stage


@dataclass(frozen=True)
class StagePlan:
    """What is to happen to one stage of a motion."""

    stage: Stage
    state: Literal["done", "next", "waits", "off"]
    """``next``: it can run now. ``waits``: an earlier stage comes first. ``off``: the recipe does not ask for it."""
    why: str = ""
    """Why it is not done."""
    slot: ArtefactSlot | None = None
    """Where the artefact lies or will lie, if its inputs are known."""
    artefact: Artefact | None = None
    """The artefact, if it is there."""


def plan(job: Job) -> Iterator[StagePlan]:
    """Yield the plan of every stage of a motion, in order. Nothing is changed but what is damaged.

    Raises:
        Kine2GoError: the inputs of the first stage cannot be read.
    """
    done: dict[str, Artefact] = {}
    missing = ""
    for stage in STAGES:
        if not stage.enabled(job):
            yield StagePlan(stage, "off")
        elif missing:
            yield StagePlan(stage, "waits", f"after {missing}")
        else:
            folder = job.workspace.artefacts / stage.name
            slot = ArtefactSlot(folder, stage.name, job.motion, json.loads(json.dumps(stage.inputs(job, done))))
            artefact = slot.get()
            if artefact is not None:
                done[stage.name] = artefact
                yield StagePlan(stage, "done", "", slot, artefact)
            else:
                missing = stage.name
                yield StagePlan(stage, "next", reason(slot), slot)


def reason(slot: ArtefactSlot) -> str:
    """Return why an artefact has to be made."""
    before = latest(slot.folder, slot.motion)
    unfinished = "; continues what was begun" if has_begun(slot.work) else ""
    if before is None:
        return "not made yet" + unfinished
    changes = difference(before.inputs, slot.inputs)
    return f"{', '.join(changes[:3])}{', ...' if len(changes) > 3 else ''}{unfinished}"


def has_begun(folder: Path) -> bool:
    """Return whether an attempt has left something in a folder."""
    return folder.is_dir() and any(folder.iterdir())


def finished_artefacts(plans: list[StagePlan]) -> dict[str, Artefact]:
    """Return the finished artefacts by stage."""
    return {one.stage.name: one.artefact for one in plans if one.artefact is not None}
