"""How a run is shown: a live table in a terminal, plain lines elsewhere, JSON for other programs."""

import json
import time
from collections.abc import Callable
from dataclasses import asdict
from types import TracebackType

from rich.console import Console
from rich.live import Live
from rich.table import Table

from kine2go_warp.cli.progress import FIRST_TIME_NOTES, PLAIN_INTERVAL
from kine2go_warp.cli.texts import printable, say
from kine2go_warp.pipelines.events import Event, RunObserver


class PlainLines(RunObserver):
    """One line for everything that matters, and now and then one of progress; a context manager that does nothing."""

    def __init__(self, write: Callable[[str], None]) -> None:
        self._write = write
        self._last: dict[str, float] = {}

    def __enter__(self) -> "PlainLines":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Nothing is left to end."""

    def on_event(self, event: Event) -> None:
        """Write a line, if it is time."""
        if event.kind == "progress":
            now = time.monotonic()
            if now - self._last.get(event.motion, 0.0) < PLAIN_INTERVAL:
                return
            self._last[event.motion] = now
        line = sentence(event)
        if line:
            self._write(printable(line))


class JsonLines(PlainLines):
    """One JSON object a line on standard output, with the time of day."""

    def on_event(self, event: Event) -> None:
        """Write the event."""
        values = {
            "time": time.time(),
            **{name: value for name, value in asdict(event).items() if value not in ("", None)},
        }
        self._write(json.dumps(values))


class LiveTable(RunObserver):
    """A table with a line for each motion that is worked on, below the lines of what has happened."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._lines = PlainLines(lambda line: console.print(line, highlight=False, markup=False, soft_wrap=True))
        self._now: dict[str, Event] = {}
        self._live = Live(console=console, get_renderable=self._table, refresh_per_second=4, transient=True)

    def __enter__(self) -> "LiveTable":
        self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._live.stop()

    def on_event(self, event: Event) -> None:
        """Take in an event."""
        if event.kind in ("stage_started", "progress"):
            self._now[event.motion] = event
        elif event.motion:
            self._now.pop(event.motion, None)
        if event.kind not in ("stage_started", "stage_finished", "progress"):
            self._lines.on_event(event)

    def _table(self) -> Table:
        """Return the table as it is now."""
        table = Table(box=None, padding=(0, 2, 0, 0))
        for heading in ("motion", "stage", "done", "reward", "accepted", "time left", ""):
            right = heading in ("done", "reward", "accepted", "time left")
            table.add_column(heading, justify="right" if right else "left", no_wrap=True)
        for motion, event in self._now.items():
            metrics = event.metrics
            table.add_row(
                motion,
                event.stage,
                f"{event.done}/{event.total}" if event.total else "",
                f"{metrics['reward']:.2f}" if metrics.get("reward") is not None else "",
                f"{metrics['accepted']:.0f}" if "accepted" in metrics else "",
                time_left(event),
                what_is_shown(event),
            )
        return table


def observer_for(as_json: bool) -> LiveTable | PlainLines:
    """Return what suits where the output goes."""
    if as_json:
        return JsonLines(lambda line: print(line, flush=True))
    console = Console(stderr=True)
    if console.is_terminal:
        return LiveTable(console)
    return PlainLines(lambda line: say(line, error=True))


def time_left(event: Event) -> str:
    """Return how long a stage still takes; a training may end before its last iteration."""
    left = duration(event.seconds_left)
    return f"at most {left}" if left and event.stage == "train" else left


def what_is_shown(event: Event) -> str:
    """Return the details of a stage, or why there are none yet."""
    if event.kind == "stage_started" or not event.total:
        return FIRST_TIME_NOTES.get(event.stage, "")
    return event.detail


def sentence(event: Event) -> str:
    """Return an event in a line of text, empty if it is not worth one."""
    where = f"{event.motion} {event.stage}".strip()
    rejected = ", ".join(f"{count} {reason}" for reason, count in event.metrics.get("reasons", {}).items())
    lines = {
        "stage_started": f"{where}: {event.detail}",
        "progress": f"{where}: {event.done}/{event.total}  {event.detail}  {time_left(event)}".rstrip(),
        "stage_finished": f"{where}: done in {duration(event.seconds)}",
        "clip_assessed": f"{event.motion}: the clip is doubtful: {event.detail}",
        "worker_died": f"{where}: {event.detail}; trying again",
        "motion_finished": f"{event.motion}: {event.metrics.get('accepted', 0)} rollouts accepted"
        + (f" (rejected: {rejected})" if rejected else ""),
        "motion_failed": f"kine2go: error: {event.motion}: {event.stage}: {event.detail}",
        "motion_stopped": f"{where}: stopped; the same command goes on from here",
        "run_finished": ", ".join(f"{count} {state}" for state, count in event.metrics.items())
        + f" in {duration(event.seconds)}",
    }
    if event.kind == "progress" and not event.total:
        return ""
    return lines.get(event.kind, "")


def duration(seconds: float | None) -> str:
    """Return a time in words."""
    if seconds is None:
        return ""
    if seconds < 60.0:
        return f"{seconds:.0f} s" if seconds >= 10.0 else f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s"
