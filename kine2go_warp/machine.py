"""The machine that something was made or measured on: its names, processor time and cores."""

import contextlib
import importlib.metadata
import os
import platform
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from pathlib import Path
from typing import TypeVar

from kine2go_warp.device import start_warp

PACKAGES = ("kine2go-warp", "newton", "warp-lang", "mujoco-warp", "mujoco", "torch", "rsl-rl-lib", "numpy", "zarr")

Job = TypeVar("Job")
Result = TypeVar("Result")

MOST_THREADS = 8
"""More would wait for one another, and each holds what it works on."""


def machine(device: str) -> dict[str, str]:
    """Return the names of processor and device, the versions of all that counts, and the date."""
    import warp as wp

    start_warp()
    driver = wp.get_cuda_driver_version()
    found = {"processor": processor_name(), "device": wp.get_device(device).name, "python": platform.python_version()}
    if driver is not None:
        found["driver"] = f"CUDA {driver[0]}.{driver[1]}"
    return {**found, **package_versions(), "date": datetime.now(UTC).strftime("%Y-%m-%d")}


def core_seconds() -> float:
    """Return the processor time of this process and of its children that have ended [s]."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def in_threads(work: Callable[[Job], Result], jobs: Iterable[Job]) -> Iterator[Result]:
    """Yield what ``work`` returns of each job, in order, doing as many at a time as there are cores.

    It gains where NumPy or a codec does the work, which leave Python to the other threads. The first error is raised,
    and nothing more is begun.
    """
    with ThreadPoolExecutor(min(MOST_THREADS, len(os.sched_getaffinity(0)))) as pool:
        yield from pool.map(work, jobs)


def package_versions() -> dict[str, str]:
    """Return the versions of the installed packages that decide what is computed."""
    found = {}
    for package in PACKAGES:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            found[package] = importlib.metadata.version(package)
    return found


def processor_name() -> str:
    """Return the name of the processor, as far as the system tells."""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
