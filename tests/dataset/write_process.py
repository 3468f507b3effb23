"""A process that writes a motion and kills itself at a step of its own choice: FOLDER KIND FIRST STRIDE.

For one step after the other it takes a copy of FOLDER/before, forks a child that writes a motion into it, and kills the
child right before that step. With KIND ``outer`` a step is a rename or the removal of a folder, except for what happens
inside the folder in which the motion is prepared; with ``all`` anything that changes the file system. The last copy
is written without a kill.
"""

import os
import shutil
import signal
import sys
from pathlib import Path

import numpy as np

from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.robots import GO2
from tests.dataset.test_store import SIMULATION, made_up

CHANGES = ("os.rename", "os.mkdir", "os.remove", "os.rmdir", "os.link")
OUTER = ("os.rename", "shutil.rmtree")


def changes_files(event: str, arguments: tuple) -> bool:
    """Whether an audit event changes the file system."""
    writing = os.O_WRONLY | os.O_RDWR | os.O_CREAT
    return event in CHANGES or (event == "open" and isinstance(arguments[2], int) and bool(arguments[2] & writing))


def is_outer(path: str) -> bool:
    """Whether a path is neither in a folder of a motion that is prepared nor in one that is deleted."""
    parents = Path(path).parts[:-1]
    return bool(parents) and not any("-new-" in part or "-junk-" in part for part in parents)


def kill_before_step(number: int, kind: str) -> None:
    """Kill this process right before its so many-th step from now."""
    steps = 0

    def count(event: str, arguments: tuple) -> None:
        nonlocal steps
        is_step = (
            event in OUTER and is_outer(os.fsdecode(arguments[0]))
            if kind == "outer"
            else changes_files(event, arguments)
        )
        if is_step:
            steps += 1
            if steps == number:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(count)


def write(store: Path) -> None:
    """Write the motion."""
    DatasetWriter(store, GO2).write("one", made_up(np.random.default_rng(1)), SIMULATION, {"rejected": {}})


def main(folder: Path, kind: str, step: int, stride: int) -> None:
    """Kill at one step after the other until there are no more."""
    while True:
        copy = folder / f"step-{step}"
        copy.mkdir()
        if (folder / "before").exists():
            shutil.copytree(folder / "before", copy / "dataset.zarr")
        child = os.fork()
        if not child:
            kill_before_step(step, kind)
            write(copy / "dataset.zarr")
            os._exit(0)
        if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) != -signal.SIGKILL:
            return
        step += stride


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))
