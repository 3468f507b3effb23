"""How fast random windows of a dataset can be read: from memory, and from the store itself."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray

from kine2go_warp.bench.measurement import BenchReport, Measurement
from kine2go_warp.dataset import OBSERVATION_ARRAYS, Dataset, open_dataset
from kine2go_warp.dataset.memory import PackedRows, load_rows
from kine2go_warp.dataset.selection import by_motion
from kine2go_warp.dataset.torch_windows import WindowDataset, WindowLoader

Serve = Callable[[], int]
"""Reads some random windows and returns how many."""


@dataclass(frozen=True)
class LoadingBench:
    """What is measured."""

    rows: int = 32
    """Rows of a window."""
    batch_size: int = 256
    """Windows of a batch."""
    arrays: tuple[str, ...] = OBSERVATION_ARRAYS
    repeats: int = 5
    seconds: float = 0.5
    """Least duration of a repeat [s]."""
    seed: int = 0
    """Of the choice of windows."""


def bench_loading(path: Path, repeats: int) -> BenchReport:
    """Read random windows of a dataset.

    Its files are in the page cache of the operating system: what is measured is the work of the processor.

    Args:
        path: The dataset.
        repeats: How often everything is measured.

    Raises:
        DatasetError: the dataset cannot be read, or no trajectory is as long as a window.
    """
    bench = LoadingBench(repeats=repeats)
    measurements = measure_loading(open_dataset(path), bench)
    return BenchReport("load", "cpu", {"rows": bench.rows, "repeats": repeats}, measurements)


def measure_loading(dataset: Dataset, bench: LoadingBench) -> tuple[Measurement, ...]:
    """Measure every way of reading windows, on the same trajectories; the values are the rates of the repeats."""
    packed = load_rows(dataset, bench.arrays)
    packed.window_starts(bench.rows)
    serves = {
        "batches from memory": serve_batches(packed, bench),
        "items from memory": serve_items(packed, bench),
        "zarr": serve_reads(zarr_read(dataset, packed, bench), packed, bench),
    }
    window = bench.rows * packed.table.shape[1] * 4
    note = f"{window:,} bytes a window"
    return tuple(Measurement(name, "windows/s", measure(serve, bench), note) for name, serve in serves.items())


def measure(serve: Serve, bench: LoadingBench) -> tuple[float, ...]:
    """Return the rate of each repeat [windows/s], after a first call that does not count."""
    serve()
    rates = []
    for _ in range(bench.repeats):
        begin = time.perf_counter()
        served, elapsed = 0, 0.0
        while elapsed < bench.seconds:
            served += serve()
            elapsed = time.perf_counter() - begin
        rates.append(served / elapsed)
    return tuple(rates)


def serve_batches(packed: PackedRows, bench: LoadingBench) -> Serve:
    """Serve whole batches from memory."""
    batch_size = min(bench.batch_size, len(packed.window_starts(bench.rows)))
    loader = WindowLoader(packed, bench.rows, batch_size, bench.seed)

    def endless() -> Iterator[int]:
        while True:
            for _ in loader:
                yield loader.batch_size

    batches = endless()
    return lambda: next(batches)


def serve_items(packed: PackedRows, bench: LoadingBench) -> Serve:
    """Serve windows from memory one by one."""
    windows, generator = WindowDataset(packed, bench.rows), np.random.default_rng(bench.seed)

    def serve() -> int:
        chosen = generator.integers(0, len(windows), 1000)
        for index in chosen:
            windows[index]
        return len(chosen)

    return serve


def serve_reads(read: Callable[[str, int, int], list[NDArray[Any]]], packed: PackedRows, bench: LoadingBench) -> Serve:
    """Serve windows one by one by a function of motion, index of the trajectory and first row."""
    generator, starts = np.random.default_rng(bench.seed), packed.window_starts(bench.rows)

    def serve() -> int:
        row = int(generator.choice(starts))
        place = int(np.searchsorted(packed.first_rows, row, side="right")) - 1
        one = packed.references[place]
        read(one.motion, one.index, row - int(packed.first_rows[place]))
        return 1

    return serve


def zarr_read(
    dataset: Dataset, packed: PackedRows, bench: LoadingBench
) -> Callable[[str, int, int], list[NDArray[Any]]]:
    """Return a function that reads a window from the store, array by array."""
    groups = {motion: zarr.open_group(dataset.path / motion, mode="r") for motion in by_motion(packed.references)}
    arrays: dict[tuple[str, str], Any] = {
        (motion, name): groups[motion][name] for motion in groups for name in bench.arrays
    }

    def read(motion: str, index: int, start: int) -> list[NDArray[Any]]:
        return [np.asarray(arrays[motion, name][index, start : start + bench.rows]) for name in bench.arrays]

    return read
