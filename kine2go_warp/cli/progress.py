"""Progress of long work: a live bar in a terminal, plain lines elsewhere."""

import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import TypeVar

import rich.progress
from rich.console import Console
from rich.table import Column

from kine2go_warp.cli.tables import console
from kine2go_warp.cli.texts import printable, sentence

Item = TypeVar("Item")

PLAIN_INTERVAL = 10.0
"""Least time between two plain lines of one stage [s]."""

FIRST_TIME_NOTES = {"train": "preparing (kernels compile once, for a minute)"}
"""What to show where a stage may be silent for long."""


def tracked(items: Iterable[Item], text: str, output: Console | None = None) -> Iterable[Item]:
    """Yield items with a bar that vanishes at the end, in a terminal only."""
    output = output or console()
    return rich.progress.track(items, text, console=output, transient=True, disable=not output.is_terminal)


@contextmanager
def bar(text: str, output: Console | None = None) -> Iterator[Callable[..., None]]:
    """Show such a bar until the block ends; yield what moves it: steps done, all steps, and what is worked on."""
    output = output or console()
    columns = (
        *rich.progress.Progress.get_default_columns(),
        rich.progress.TextColumn("{task.fields[detail]}", markup=False),
    )
    with rich.progress.Progress(*columns, console=output, transient=True, disable=not output.is_terminal) as shown:
        task = shown.add_task(text, total=None, detail="")
        yield lambda done, total, detail="": shown.update(task, completed=done, total=total, detail=detail)


class Progress:
    """Shows one line a stage. Use it as a context manager."""

    def __init__(self) -> None:
        self.console = Console(stderr=True)
        self.live = rich.progress.Progress(
            rich.progress.TextColumn("{task.description}", markup=False, table_column=Column(no_wrap=True)),
            rich.progress.BarColumn(bar_width=12),
            rich.progress.TaskProgressColumn(),
            rich.progress.TimeRemainingColumn(compact=True),
            rich.progress.TextColumn("{task.fields[detail]}", markup=False, table_column=Column(no_wrap=True)),
            console=self.console,
            disable=not self.console.is_terminal,
        )
        self.task: rich.progress.TaskID | None = None
        self.label = ""
        self.last_line = 0.0
        self.opening = threading.Timer(0.0, print)
        """Prints, where there is no terminal, that a stage has started, unless other output comes first."""

    def __enter__(self) -> "Progress":
        self.live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.opening.cancel()
        self.live.stop()

    def stage(self, motion: str, stage: str) -> None:
        """A stage of a motion begins."""
        self._complete()
        self.label = printable(f"{motion} {stage}")
        self.last_line = time.monotonic()
        note = FIRST_TIME_NOTES.get(stage, "")
        if self.console.is_terminal:
            self.task = self.live.add_task(self.label, total=None, detail=note)
        else:
            # Delayed, so that an error in the input, which is found in the first seconds, stays the only line.
            self.opening = threading.Timer(PLAIN_INTERVAL, self._line, [f"{self.label}: {note or 'started'}"])
            self.opening.daemon = True
            self.opening.start()

    def advanced(self, done: int, total: int, detail: str) -> None:
        """The present stage has done some of its steps."""
        if self.task is not None:
            self.live.update(self.task, completed=done, total=total, detail=detail)
        elif not self.console.is_terminal:
            now = time.monotonic()
            if done == total or now - self.last_line >= PLAIN_INTERVAL:
                self.last_line = now
                self._line(f"{self.label}: {done}/{total}  {detail}".rstrip())

    def note(self, text: str) -> None:
        """Something that the user should know."""
        self._line(f"kine2go: note: {text}")

    def _line(self, text: str) -> None:
        """Print a line as it is."""
        self.opening.cancel()
        self.console.print(sentence(text), highlight=False, soft_wrap=True, markup=False)

    def _complete(self) -> None:
        """Fill the bar of the stage that ends."""
        self.opening.cancel()
        if self.task is not None:
            total = self.live.tasks[-1].total or 1
            self.live.update(self.task, completed=total, total=total)
            self.task = None
