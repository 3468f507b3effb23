"""What a worker does: the next stage of a motion, with a log, wherever it is called."""

import platform
import time
import traceback
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Literal

from kine2go_warp import __version__
from kine2go_warp.errors import Kine2GoError, explain
from kine2go_warp.interruption import TrainingInterrupted
from kine2go_warp.machine import core_seconds
from kine2go_warp.pipelines.artefacts import ArtefactRecord
from kine2go_warp.pipelines.job import Job, Monitor, StageStopped
from kine2go_warp.pipelines.plan import StagePlan, finished_artefacts, plan
from kine2go_warp.pipelines.stages import StageOutput
from kine2go_warp.pipelines.workspace import MotionLog
from kine2go_warp.revision import revision


@dataclass(frozen=True)
class Outcome:
    """What became of one stage of a motion. It can be sent to another process."""

    motion: str
    stage: str
    """The stage that was worked on."""
    state: Literal["done", "failed", "stopped", "died"]
    """``stopped``: because it was asked to. ``died``: the worker is gone."""
    seconds: float = 0.0
    why: str = ""
    """Why it failed, in one line."""


def run_stage(job: Job, stage: str) -> Outcome:
    """Make the next missing artefact of a motion. Errors become an outcome, so that they reach any engine alike.

    Args:
        job: The motion.
        stage: The stage that comes next; another one means that this process runs other software than the caller.
    """
    log = MotionLog(job.workspace.log(job.motion))
    started = time.monotonic()

    def outcome(state: Literal["done", "failed", "stopped"], why: str = "") -> Outcome:
        if state != "done":
            log.write(f"{stage} {state}: {why}")
        return Outcome(job.motion, stage, state, time.monotonic() - started, " ".join(why.split()))

    try:
        plans = list(plan(job))
        following = next((one for one in plans if one.state == "next"), None)
        if following is None or following.stage.name != stage:
            here = "nothing" if following is None else following.stage.name
            return outcome("failed", f"a worker has {here} to do: its software or files differ; start the run again")
        log.write(f"{stage} begins on {job.device}: {following.why}")
        made = make(job, following, plans)
        log.write(f"{stage} done in {time.monotonic() - started:.1f} s: {made.metrics}")
        return outcome("done")
    except (TrainingInterrupted, StageStopped) as error:
        return outcome("stopped", str(error))
    except Kine2GoError as error:
        return outcome("failed", str(error))
    except OSError as error:
        return outcome("failed", explain(error))
    except Exception as error:  # noqa: BLE001 - a defect in one motion must not stop the others
        log.write(traceback.format_exc())
        return outcome("failed", f"{error.__class__.__name__}: {error}")


def make(job: Job, following: StagePlan, plans: list[StagePlan]) -> StageOutput:
    """Make one artefact."""
    slot, stage = following.slot, following.stage
    assert slot is not None
    started, core_started = time.monotonic(), core_seconds()
    monitor = Monitor(job, stage.name)
    with slot.build(keep=stage.resumable) as folder:
        made = stage.make(job, finished_artefacts(plans), folder, monitor)
        record = ArtefactRecord(
            stage=stage.name,
            motion=job.motion,
            inputs=slot.inputs,
            output=made.output,
            metrics=made.metrics,
            seconds=round(time.monotonic() - started, 3),
            core_seconds=round(core_seconds() - core_started, 3),
            finished=datetime.now(UTC).isoformat(timespec="microseconds"),
            software=f"{__version__} {revision()}".strip(),
            machine=f"{platform.node()} {job.device}",
        )
        slot.finish(record)
    return made
