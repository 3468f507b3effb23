"""How fast random windows can be read: from memory, and from files of several formats with the same content."""

import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.access import Dataset
from kine2go_warp.dataset.memory import OBSERVATION_ARRAYS, PackedRows, load_rows
from kine2go_warp.dataset.selection import by_motion

Serve = Callable[[], int]
"""Reads some random windows and returns how many."""

Read = Callable[[str, int, int], list[NDArray]]
"""Reads the window of a motion, an index of a trajectory and a first row in it: its arrays."""


@dataclass(frozen=True)
class LoadingRate:
    """How fast one way of reading random windows is."""

    method: str
    """One of ``METHODS``."""
    windows_per_second: float
    """Median over the repeats; 0 if it was not measured."""
    slowest: float
    """Slowest repeat [windows/s]."""
    fastest: float
    """Fastest repeat [windows/s]."""
    megabytes_per_second: float
    """Numbers delivered, at the median rate [MB/s]."""
    note: str = ""
    """Why it was not measured."""


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


@dataclass(frozen=True)
class Material:
    """What a way of reading windows may use."""

    dataset: Dataset
    packed: PackedRows
    bench: LoadingBench
    folder: Path
    """Empty, for files of its own."""
    stack: ExitStack
    """Closes what it opens."""


def measure_loading(
    dataset: Dataset, bench: LoadingBench | None = None, on_method: Callable[[int, int], None] | None = None
) -> list[LoadingRate]:
    """Measure every way of reading windows, on the same trajectories; files are written into a temporary folder.

    The files are in the page cache of the operating system: what is measured is the work of the processor.

    Args:
        dataset: The dataset, or a selection of it.
        bench: What to measure.
        on_method: Called with the methods measured and their total.

    Raises:
        DatasetError: no trajectory is as long as a window, or there is no such array.
    """
    bench = bench or LoadingBench()
    packed = load_rows(dataset, bench.arrays)
    packed.window_starts(bench.rows)
    width = packed.table.shape[1]
    rates = []
    for method, make in METHODS.items():
        with ExitStack() as stack:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="kine2go-bench-")))
            try:
                found = measure(make(Material(dataset, packed, bench, folder, stack)), bench)
            except ModuleNotFoundError as error:
                rates.append(LoadingRate(method, 0.0, 0.0, 0.0, 0.0, f"{error.name} is not installed"))
            else:
                median = statistics.median(found)
                megabytes = median * bench.rows * width * 4 / 1e6
                rates.append(LoadingRate(method, median, min(found), max(found), megabytes))
        if on_method is not None:
            on_method(len(rates), len(METHODS))
    return rates


def measure(serve: Serve, bench: LoadingBench) -> list[float]:
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
    return rates


def serve_batches(material: Material) -> Serve:
    """Serve whole batches from memory."""
    from kine2go_warp.dataset.torch_windows import WindowLoader

    packed, bench = material.packed, material.bench
    batch_size = min(bench.batch_size, len(packed.window_starts(bench.rows)))
    loader = WindowLoader(packed, bench.rows, batch_size, bench.seed)

    def endless() -> Iterator[int]:
        while True:
            for _ in loader:
                yield loader.batch_size

    batches = endless()
    return lambda: next(batches)


def serve_items(material: Material) -> Serve:
    """Serve windows from memory one by one."""
    from kine2go_warp.dataset.torch_windows import WindowDataset

    windows = WindowDataset(material.packed, material.bench.rows)
    generator = np.random.default_rng(material.bench.seed)

    def serve() -> int:
        chosen = generator.integers(0, len(windows), 1000)
        for index in chosen:
            windows[index]
        return len(chosen)

    return serve


def serve_reads(make_read: Callable[[Material], Read], material: Material) -> Serve:
    """Serve windows from files one by one."""
    read, packed, rows = make_read(material), material.packed, material.bench.rows
    generator = np.random.default_rng(material.bench.seed)
    starts = packed.window_starts(rows)

    def serve() -> int:
        row = int(generator.choice(starts))
        place = int(np.searchsorted(packed.first_rows, row, side="right")) - 1
        one = packed.references[place]
        read(one.motion, one.index, row - int(packed.first_rows[place]))
        return 1

    return serve


def zarr_read(material: Material) -> Read:
    """Read from the store itself, array by array."""
    import zarr

    path, bench = material.dataset.path, material.bench
    groups = {motion: zarr.open_group(path / motion, mode="r") for motion in by_motion(material.packed.references)}
    arrays: dict[tuple[str, str], Any] = {
        (motion, name): groups[motion][name] for motion in groups for name in bench.arrays
    }

    def read(motion: str, index: int, start: int) -> list[NDArray]:
        return [np.asarray(arrays[motion, name][index, start : start + bench.rows]) for name in bench.arrays]

    return read


def hdf5_read(material: Material) -> Read:
    """Read from an open HDF5 file, one array a motion, chunked by trajectory, not compressed."""
    import h5py

    path, bench = material.folder / "dataset.h5", material.bench
    groups = by_motion(material.packed.references)
    with h5py.File(path, "w") as file:
        for motion in groups:
            for name in bench.arrays:
                values = np.stack(list(padded(material.dataset, motion, name)))
                file.create_dataset(f"{motion}/{name}", data=values, chunks=(1, *values.shape[1:]))
    file = material.stack.enter_context(h5py.File(path, "r"))
    arrays: dict[tuple[str, str], Any] = {
        (motion, name): file[f"{motion}/{name}"] for motion in groups for name in bench.arrays
    }
    places = {(one.motion, one.index): place for group in groups.values() for place, one in enumerate(group)}

    def read(motion: str, index: int, start: int) -> list[NDArray]:
        place = places[motion, index]
        return [np.asarray(arrays[motion, name][place, start : start + bench.rows]) for name in bench.arrays]

    return read


def npz_read(material: Material) -> Read:
    """Read from one .npz file a trajectory, opened for each window."""
    folder, bench = material.folder, material.bench
    for one in material.dataset.trajectories(arrays=bench.arrays):
        (folder / one.motion).mkdir(exist_ok=True)
        np.savez(folder / one.motion / f"{one.index}.npz", allow_pickle=False, **one.arrays)

    def read(motion: str, index: int, start: int) -> list[NDArray]:
        with np.load(folder / motion / f"{index}.npz", allow_pickle=False) as file:
            return [file[name][start : start + bench.rows] for name in bench.arrays]

    return read


def padded(dataset: Dataset, motion: str, name: str) -> Iterator[NDArray]:
    """Yield one array of each trajectory of a motion, all of the same length, padded with NaN."""
    longest = max(one.length for one in dataset.select([motion]).references)
    for one in dataset.trajectories([motion], [name]):
        values = one.arrays[name]
        filler = np.full((longest - one.length, *values.shape[1:]), np.nan, dtype=values.dtype)
        yield np.concatenate([values, filler])


METHODS: dict[str, Callable[[Material], Serve]] = {
    "batches from memory": serve_batches,
    "items from memory": serve_items,
    "zarr": partial(serve_reads, zarr_read),
    "hdf5": partial(serve_reads, hdf5_read),
    "npz": partial(serve_reads, npz_read),
}
"""Ways of reading windows by name."""
