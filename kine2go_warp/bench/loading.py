"""How fast a dataset is read, against other ways to keep the same data."""

from pathlib import Path

from kine2go_warp.bench.measurement import BenchReport, Measurement
from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.bench import LoadingBench, measure_loading


def bench_loading(path: Path, repeats: int) -> BenchReport:
    """Read random windows of a dataset.

    Args:
        path: The dataset.
        repeats: How often everything is measured.
    """
    bench = LoadingBench(repeats=repeats)
    rates = measure_loading(open_dataset(path), bench)
    measurements = tuple(
        Measurement(
            rate.method,
            "windows/s",
            (rate.slowest, rate.windows_per_second, rate.fastest),
            rate.note or f"{rate.megabytes_per_second:,.0f} MB/s",
        )
        for rate in rates
    )
    return BenchReport("load", "cpu", {"rows": bench.rows, "repeats": repeats}, measurements)
