"""Motions and stages of a recipe as a table."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from kine2go_warp.cli.run_progress import duration
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.pipelines.job import Job, read_progress
from kine2go_warp.pipelines.plan import StagePlan, plan
from kine2go_warp.pipelines.stages import STAGES
from kine2go_warp.pipelines.workspace import Workspace, is_locked, lock_holder
from kine2go_warp.tables import make_table

METRICS = {"accepted": "{:.0f}", "joint_rmse": "{:.3f}", "root_error": "{:.3f}", "foot_slip": "{:.3f}"}
"""Metrics of a motion that are shown, and how."""


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


def motion_status(job: Job, is_running: bool) -> MotionStatus:
    """Return what is known of one motion."""
    found = MotionStatus(job.motion)
    note = read_progress(job.workspace.progress(job.motion)) if is_running else None
    try:
        for one in plan(job):
            found.stages[one.stage.name] = cell(one)
            if one.artefact is not None:
                found.metrics.update(one.artefact.record.metrics)
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


def print_status(jobs: Sequence[Job], as_json: bool) -> None:
    """Print what is done, what would run and why, and what failed."""
    workspace: Workspace = jobs[0].workspace
    running = is_locked(workspace.root)
    found = [motion_status(job, running) for job in jobs]
    if as_json:
        values = {"folder": str(workspace.root), "running": running, "motions": [vars(one) for one in found]}
        print(json.dumps(values, indent=2))
        return

    from kine2go_warp.cli.tables import print_table, say

    who = f", now running: {lock_holder(workspace.root / '.lock')}" if running else ""
    headings = ("motion", *(stage.name for stage in STAGES), *(name.replace("_", " ") for name in METRICS))
    rows = []
    for one in found:
        metrics = [form.format(one.metrics[name]) if name in one.metrics else "" for name, form in METRICS.items()]
        rows.append((one.motion, *(one.stages.get(stage.name, "-") for stage in STAGES), *metrics))
    print_table(make_table(f"{workspace.root}{who}", headings, rows, ("motion",)))
    for one in found:
        if remarks := one.metrics.get("clip_remarks"):
            say(f"{one.motion}: the clip is doubtful: {'; '.join(remarks)}")
        if one.next_stage:
            say(f"{one.motion}: would run {one.next_stage}: {one.why}")
        if one.failure:
            say(f"{one.motion}: failed last time at {one.failure}")
    if not any(one.next_stage for one in found):
        say("everything is done")
