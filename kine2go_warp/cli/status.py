"""Motions and stages of a recipe as a table, and their results as one for documents."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from kine2go_warp.cli.run_progress import duration
from kine2go_warp.cli.texts import say
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.files import atomic_file, lock_holder
from kine2go_warp.pipelines.job import Job, read_progress
from kine2go_warp.pipelines.plan import StagePlan, plan
from kine2go_warp.pipelines.stages import STAGES
from kine2go_warp.pipelines.workspace import Workspace, is_locked
from kine2go_warp.tables import Cell, make_table, markdown

METRICS = {
    "iterations": "{:.0f}",
    "stopped": "{}",
    "accepted": "{:.0f}",
    "joint_rmse": "{:.3f}",
    "root_error": "{:.3f}",
    "foot_slip": "{:.3f}",
}
"""Metrics of a motion that are shown, and how."""
RESULTS = ("iterations", "stopped because", "accepted", "joint RMSE [rad]", "root error [cm]", "foot slip [m/s]",
           "power [W]", "wall [min]", "core [min]")  # fmt: skip
"""Columns of the results, after the motion."""


@dataclass
class MotionStatus:
    """What is known of one motion."""

    motion: str
    stages: dict[str, str] = field(default_factory=dict)
    """By stage: its time, or what is going on."""
    next_stage: str = ""
    """The stage that would run, empty if all are done."""
    why: str = ""
    """Why it would run."""
    failure: str = ""
    """Why the last run failed at this motion, if it did."""
    metrics: dict[str, Any] = field(default_factory=dict)
    seconds: float = 0.0
    """Time that the stages took [s]."""
    core_seconds: float = 0.0
    """Processor time that they took [s]."""


def motion_status(job: Job, is_running: bool) -> MotionStatus:
    """Return what is known of one motion."""
    found = MotionStatus(job.motion)
    note = read_progress(job.workspace.progress(job.motion)) if is_running else None
    try:
        for one in plan(job):
            found.stages[one.stage.name] = cell(one)
            if one.artefact is not None:
                found.metrics.update(one.artefact.record.metrics)
                found.seconds += one.artefact.record.seconds
                found.core_seconds += one.artefact.record.core_seconds
            if one.state == "next":
                found.next_stage, found.why = one.stage.name, one.why
                if note is not None and note.stage == one.stage.name:
                    found.stages[note.stage] = f"{note.done}/{note.total}" if note.total else "begun"
    except Kine2GoError as error:
        found.next_stage, found.why = STAGES[len(found.stages)].name, str(error)
    try:
        failure = json.loads(job.workspace.failure(job.motion).read_text())
        found.failure = f"{failure['stage']}: {failure['why']} (log: {failure['log']})"
    except (OSError, ValueError, KeyError):
        found.failure = ""
    return found


def cell(one: StagePlan) -> str:
    """Return the state of a stage in a word or two."""
    if one.artefact is not None:
        return duration(one.artefact.record.seconds)
    return {"next": "to do", "waits": "-", "off": "off", "done": ""}[one.state]


def results_table(found: Sequence[MotionStatus]) -> str:
    """Return what became of each motion, as a table in Markdown with a last row for all of them."""
    rows = [(Cell(one.motion, code=True), *results(one)) for one in found]
    done = [one for one in found if not one.next_stage]
    minutes = (f"{sum(getattr(one, name) for one in found) / 60.0:.1f}" for name in ("seconds", "core_seconds"))
    total = [f"{len(done)} of {len(found)} motions done", *[""] * (len(RESULTS) - 2), *minutes]
    return markdown(make_table("", ("motion", *RESULTS), [*rows, total]))


def results(one: MotionStatus) -> tuple[str, ...]:
    """Return the results of a motion, empty where there are none yet."""
    metrics, reason = one.metrics, one.metrics.get("stopped", "")
    accepted = one.failure
    if "accepted" in metrics:
        accepted = f"{metrics['accepted']} of {metrics['accepted'] + metrics['rejected']}"
        if metrics["reasons"]:
            named = ", ".join(f"{name.replace('_', ' ')} {count}" for name, count in metrics["reasons"].items())
            accepted += f" (rejected: {named})"
    scales = {"joint_rmse": ("{:.3f}", 1.0), "root_error": ("{:.1f}", 100.0), "foot_slip": ("{:.3f}", 1.0)}
    scales["power"] = ("{:.0f}", 1.0)
    numbers = [form.format(scale * metrics[name]) if name in metrics else "" for name, (form, scale) in scales.items()]
    minutes = [f"{seconds / 60.0:.1f}" if seconds else "" for seconds in (one.seconds, one.core_seconds)]
    return (str(metrics.get("iterations", "")), reason, accepted, *numbers, *minutes)


def print_status(jobs: Sequence[Job], as_json: bool, document: Path | None = None) -> None:
    """Print what is done, what would run and why, and what failed.

    Args:
        jobs: The motions.
        as_json: Print JSON instead.
        document: File for the results as a table in Markdown.
    """
    workspace: Workspace = jobs[0].workspace
    running = is_locked(workspace.root)
    found = [motion_status(job, running) for job in jobs]
    if document is not None:
        with atomic_file(document) as temporary:
            temporary.write_text(results_table(found))
    if as_json:
        values = {"folder": str(workspace.root), "running": running, "motions": [vars(one) for one in found]}
        print(json.dumps(values, indent=2))
        return

    from kine2go_warp.cli.tables import print_table

    who = f", now running: {lock_holder(workspace.root / '.lock')}" if running else ""
    headings = ("motion", *(stage.name for stage in STAGES), *(name.replace("_", " ") for name in METRICS))
    rows = []
    for one in found:
        metrics = [form.format(one.metrics[name]) if name in one.metrics else "" for name, form in METRICS.items()]
        rows.append((one.motion, *(one.stages.get(stage.name, "-") for stage in STAGES), *metrics))
    print_table(make_table(f"{workspace.root}{who}", headings, rows, ("motion", "stopped")))
    for one in found:
        if remarks := one.metrics.get("clip_remarks"):
            say(f"{one.motion}: the clip is doubtful: {'; '.join(remarks)}")
        if one.next_stage:
            say(f"{one.motion}: would run {one.next_stage}: {one.why}")
        if one.failure:
            say(f"{one.motion}: failed last time at {one.failure}")
    if not any(one.next_stage for one in found):
        say("everything is done")
