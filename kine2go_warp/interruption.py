"""Stopping long work when the user asks for it: gently at first, at once if asked again."""

import os
import signal
from types import FrameType, TracebackType
from typing import Any

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Terminated(KeyboardInterrupt):
    """The process was asked to end, or its terminal was closed; what it does about Ctrl-C it does about this."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.status = 128 + number
        """Exit status that shells give for the signal."""


def end_like_interrupted() -> None:
    """Make SIGTERM and SIGHUP raise ``Terminated``, so that temporary files are removed; ``nohup`` stays in force."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _terminate)


def _terminate(number: int, _frame: FrameType | None) -> None:
    """Raise what ends the process."""
    raise Terminated(number)


class TrainingInterrupted(KeyboardInterrupt):
    """Training has stopped on request, after writing a checkpoint from which it continues exactly.

    Not an error: like ``KeyboardInterrupt`` it passes through what handles errors, and the command line exits with 130.
    """


class StopRequest:
    """Turns the first Ctrl-C (or SIGTERM) into a wish; the second raises ``KeyboardInterrupt``.

    Use it as a context manager around work that calls it now and then, as in ``train(..., should_stop=stop)``. Outside
    the main thread, where Python lets nobody handle signals, it is never set by one.
    """

    def __init__(self, message: str = "stopping at the next checkpoint; once more stops at once") -> None:
        """Prepare.

        Args:
            message: What the first signal writes to standard error.
        """
        self.message = message
        self.requested = False
        self._earlier: dict[signal.Signals, Any] = {}

    def __call__(self) -> bool:
        """Return whether to stop."""
        return self.requested

    def __enter__(self) -> "StopRequest":
        try:
            for number in SIGNALS:
                self._earlier[number] = signal.signal(number, self._handle)
        except ValueError:
            self._earlier.clear()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        for number, handler in self._earlier.items():
            signal.signal(number, handler)

    def _handle(self, _number: int, _frame: FrameType | None) -> None:
        """Note the wish, or give in."""
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True
        # Not print: the signal may have come in the middle of another one.
        os.write(2, f"\nkine2go: {self.message}\n".encode())
