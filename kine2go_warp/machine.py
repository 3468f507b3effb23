"""The machine that something was made or measured on, and its processor time."""

import contextlib
import importlib.metadata
import os
import platform
from datetime import UTC, datetime
from pathlib import Path

from kine2go_warp.device import start_warp

PACKAGES = ("kine2go-warp", "newton", "warp-lang", "mujoco-warp", "mujoco", "torch", "rsl-rl-lib", "numpy", "zarr")


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
