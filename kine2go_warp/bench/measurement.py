"""A figure measured several times, and the machine that it was measured on."""

import statistics
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from kine2go_warp.machine import machine


@dataclass(frozen=True)
class Measurement:
    """One figure, measured several times in one run."""

    name: str
    unit: str
    values: tuple[float, ...]
    note: str = ""

    @property
    def median(self) -> float:
        """The middle value."""
        return statistics.median(self.values)

    @property
    def spread(self) -> tuple[float, float]:
        """The lowest and the highest value."""
        return min(self.values), max(self.values)

    def as_record(self) -> dict[str, Any]:
        """Return the figure as JSON values."""
        lowest, highest = self.spread
        return {**asdict(self), "median": self.median, "lowest": lowest, "highest": highest}


@dataclass(frozen=True)
class BenchReport:
    """What one benchmark has found."""

    stage: str
    device: str
    settings: dict[str, Any]
    measurements: tuple[Measurement, ...]

    def as_record(self) -> dict[str, Any]:
        """Return everything as JSON values, with machine, versions and date."""
        return {
            "stage": self.stage,
            "device": self.device,
            "settings": self.settings,
            "machine": machine(self.device),
            "measurements": [measurement.as_record() for measurement in self.measurements],
        }

    def values_of(self, name: str) -> tuple[float, ...]:
        """Return what a figure was in each repeat."""
        return next(measurement.values for measurement in self.measurements if measurement.name == name)


def timed(action: Callable[[], object], synchronise: Callable[[], object] = lambda: None) -> float:
    """Return how long an action takes [s], what it left to do on the device included."""
    synchronise()
    start = time.perf_counter()
    action()
    synchronise()
    return time.perf_counter() - start


def resident_memory() -> float:
    """Return the memory of this process [MB], 0 where the system does not tell."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError:
        return 0.0
    import os

    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
