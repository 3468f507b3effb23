"""Work that is killed: in children of a process in which Python and the simulator start only once.

The module that is started calls ``serve``; the test asks it for work through a ``KillableWorker``.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from tests.conftest import REPOSITORY


class KillableWorker:
    """A process ``python -m MODULE ARGUMENTS`` that works when asked to, each time in a child that can be killed."""

    def __init__(self, module: str, *arguments: Path) -> None:
        command = [sys.executable, "-m", module, *map(str, arguments)]
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(command, cwd=REPOSITORY, stdin=pipe, stdout=pipe, text=True)
        assert self._line() == ["ready"]

    def ask(self, *words: object, kill_after: float | None = None) -> tuple[int, float]:
        """Ask for work; returns exit status (-9 if it was killed) and time taken [s]."""
        print(*words, sep="\t", file=self.process.stdin, flush=True)
        child = int(self._line()[0])
        if kill_after is not None:
            time.sleep(kill_after)
            # The child is not waited for before it is killed, or has ended: its number is not another's.
            os.kill(child, signal.SIGKILL) if Path(f"/proc/{child}").exists() else None
        status, seconds = self._line()
        return int(status), float(seconds)

    def _line(self) -> list[str]:
        return self.process.stdout.readline().split()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None):
        self.process.stdin.close()
        self.process.wait()
        self.process.stdout.close()


def serve(work: Callable[..., int | None]) -> None:
    """Do ``work`` in a child for each line on the standard input, whose words are its arguments.

    The child's number is printed, then how it ended and the time that it took [s].
    """
    print("ready", flush=True)
    for line in sys.stdin:
        child = os.fork()
        if not child:
            os._exit(work(*line.rstrip("\n").split("\t")) or 0)
        print(child, flush=True)
        started = time.perf_counter()
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        print(status, time.perf_counter() - started, flush=True)


def spread_moments(kills: int) -> Iterator[float]:
    """Yield random moments within a life, as shares of it, spread over the whole of it."""
    rng = np.random.default_rng(0)
    for part in rng.permutation(kills):
        yield (part + rng.random()) / kills
