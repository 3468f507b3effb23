"""Tables of results on standard output."""

import importlib.metadata
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from kine2go_warp.device import start_warp
from kine2go_warp.motions.catalogue import CatalogueEntry
from kine2go_warp.motions.cycle_search import CycleCandidate
from kine2go_warp.motions.poses import Poses

if TYPE_CHECKING:
    from kine2go_warp.bench.measurement import BenchReport
    from kine2go_warp.dataset.summary import MotionSummary
    from kine2go_warp.motions.fetch import FileState
    from kine2go_warp.motions.quality import ClipQuality
    from kine2go_warp.rollouts.gather import GatherResult
    from kine2go_warp.rollouts.replay import ReplayResult
    from kine2go_warp.scores.distributions import Distribution

PACKAGES = (
    "kine2go-warp",
    "newton",
    "warp-lang",
    "mujoco-warp",
    "torch",
    "rsl-rl-lib",
    "onnxruntime",
    "placo",
    "zarr",
    "rerun-sdk",
)


def console() -> Console:
    """Return a console that does not fold tables when the output is piped."""
    output = Console()
    return output if output.is_terminal else Console(width=140)


def print_summaries(summaries: Sequence["MotionSummary"], dataset: Path, recordings: Path | None = None) -> None:
    """Print what a dataset holds, computed from the data written."""
    table = Table(title=f"{dataset} (figures computed from the data written)", title_justify="left")
    headings = ("joint RMSE\n\\[rad]", "root error\n\\[cm]", "root angle\n\\[rad]", "foot error\n\\[cm]")
    for heading in ("motion", "accepted", "rejected\nin review", "duration\n\\[s]", *headings):
        table.add_column(heading, justify="left" if heading == "motion" else "right")
    for row in summaries:
        table.add_row(
            row.motion,
            f"{row.accepted}/{row.total}",
            str(row.rejected_in_review),
            f"{row.shortest:.1f}" if row.shortest == row.longest else f"{row.shortest:.1f}-{row.longest:.1f}",
            f"{row.joint_rmse:.3f}",
            f"{100.0 * row.root_error:.1f}",
            f"{row.root_angle:.3f}",
            f"{100.0 * row.foot_error:.1f}",
        )
    output = console()
    output.print(table)
    if recordings is not None:
        for row in summaries:
            path = recordings / f"{row.motion}.rrd"
            if path.is_file():
                output.print(f"look at it: rerun {path}", highlight=False, soft_wrap=True)


def print_rejections(result: "GatherResult") -> None:
    """Print why rollouts were rejected, which ones are worth a look, and how fast they were gathered."""
    output = console()
    if result.rejected:
        table = Table(title=f"{result.motion}: rejected rollouts", title_justify="left")
        table.add_column("reason")
        table.add_column("rollouts", justify="right")
        for reason, count in sorted(result.rejected.items(), key=lambda item: -item[1]):
            table.add_row(reason, str(count))
        output.print(table)
    if result.borderline:
        numbers = ", ".join(str(number) for number in result.borderline)
        output.print(
            f"{result.motion}: worth a look, the most doubtful first: {numbers}", highlight=False, soft_wrap=True
        )
    if result.is_new:
        output.print(
            f"{result.motion}: {result.rows_per_second:,.0f} rows/s and {result.megabytes_per_second:.1f} MB/s while "
            f"simulating, {100.0 * result.waiting_share:.1f} % of it waiting for the disk; dataset written in "
            f"{result.write_time:.1f} s",
            highlight=False,
            soft_wrap=True,
        )


def print_distributions(motion: str, figures: "Sequence[Distribution]", attributes: dict[str, Any]) -> None:
    """Print the figures of a motion's rollouts, why rollouts were rejected, and which ones are worth a look."""
    table = Table(title=f"{motion}: {len(figures[0].accepted)} accepted rollouts", title_justify="left")
    for heading in ("figure", "unit", "median", "90 %", "largest", "limit"):
        table.add_column(heading, justify="left" if heading in ("figure", "unit") else "right")
    for one in figures:
        values = (one.quantile(0.5), one.quantile(0.9), one.quantile(1.0), one.limit)
        table.add_row(one.name, escape(one.unit), *(f"{value:.4g}" for value in values))
    output = console()
    output.print(table)
    rejected = ", ".join(f"{count} {reason}" for reason, count in attributes.get("rejected", {}).items())
    output.print(f"rejected: {rejected or 'none'}", highlight=False)
    doubtful = ", ".join(str(number) for number in attributes.get("borderline", ()))
    output.print(f"worth a look, the most doubtful first: {doubtful or 'none'}", highlight=False, soft_wrap=True)


def print_replays(results: "Sequence[tuple[str, str, list[ReplayResult]]]", engine: str) -> None:
    """Print how replays compare with the record."""
    from kine2go_warp.rollouts.replay import HORIZONS

    title = f"replay in {engine}: largest differences of root [mm] and joints [mrad] within a time"
    table = Table(title=escape(title), title_justify="left")
    times = (*(f"{horizon} s" for horizon in HORIZONS), "to the end")
    for heading in ("motion", "device", "trajectory", "rows", "same bits", *times):
        table.add_column(heading, justify="left" if heading in ("motion", "device") else "right")
    for motion, device, found in results:
        for one in found:
            same = "all" if one.first_difference is None else f"before row {one.first_difference}"
            shown = (
                f"{1e3 * root:.3g} / {1e3 * joint:.3g}"
                for root, joint in zip(one.root_difference, one.joint_difference, strict=True)
            )
            table.add_row(motion, device, str(one.trajectory), str(one.num_rows), same, *shown)
    console().print(table)


def print_clips(qualities: Sequence["ClipQuality"], remarks: dict[str, list[str]], folder: Path) -> None:
    """Print the metrics of retargeted clips."""
    table = Table(title=str(folder), title_justify="left")
    headings = ("clip", "frames", "period", "speed", "pitch", "swings", "duty", "height", "seam", "slip", "remarks")
    for heading in headings:
        table.add_column(heading, justify="left" if heading in ("clip", "remarks") else "right")
    for row in qualities:
        ours = row.fidelity
        table.add_row(
            row.name,
            f"{row.start}-{row.end}",
            f"{row.period:.2f} s",
            f"{row.speed:.2f} m/s",
            f"{ours.trunk_pitch:+.1f} deg",
            f"{ours.swing_front:.2f} {ours.swing_hind:.2f}",
            f"{ours.duty:+.3f}",
            f"r {ours.height_correlation:.2f}",
            f"{ours.seam_acceleration:.1f} m/s^2",
            f"{ours.contact_slip:.3f} m/s",
            "; ".join(remarks[row.name]),
        )
    console().print(table)


def print_cycles(found: Sequence[CycleCandidate], rate: float, targets: Poses, file: Path) -> None:
    """Print the best ranges of a motion."""
    table = Table(title=f"{file}: best cycles", title_justify="left")
    for heading in ("start", "end", "frames", "duration", "way", "seam score"):
        table.add_column(heading, justify="right")
    for one in found:
        way = np.linalg.norm(targets.root_position[one.end, :2] - targets.root_position[one.start, :2])
        frames = one.end - one.start
        table.add_row(
            str(one.start), str(one.end), str(frames), f"{frames / rate:.2f} s", f"{way:.2f} m", f"{one.score:.2f}"
        )
    console().print(table)


def print_bench(report: "BenchReport") -> None:
    """Print what a benchmark has found, and where."""
    from kine2go_warp.machine import machine

    settings = ", ".join(f"{value:,} {name}" for name, value in report.settings.items())
    table = Table(title=f"{report.stage} on {report.device}: {settings}", title_justify="left")
    for heading in ("figure", "median", "lowest", "highest", "unit", "what it is"):
        table.add_column(heading, justify="right" if heading in ("median", "lowest", "highest") else "left")
    for row in report.measurements:
        shown = (f"{value:,.0f}" if value >= 100.0 else f"{value:.3f}" for value in (row.median, *row.spread))
        table.add_row(row.name, *shown, row.unit, row.note)
    output = console()
    output.print(table)
    output.print(", ".join(f"{name} {value}" for name, value in machine(report.device).items()), highlight=False)


def print_machine() -> None:
    """Print versions and devices."""
    import warp as wp

    start_warp()
    table = Table(title="software and devices", title_justify="left", show_header=False)
    table.add_row("Python", platform.python_version())
    for package in PACKAGES:
        try:
            table.add_row(package, importlib.metadata.version(package))
        except importlib.metadata.PackageNotFoundError:
            table.add_row(package, "missing")
    for device in wp.get_devices():
        table.add_row(f"device {device.alias}", device.name)
    table.add_row("used by default", "cuda:0" if wp.is_cuda_available() else "cpu")
    table.add_row("kernel cache", str(wp.config.kernel_cache_dir))
    console().print(table)


def print_motions(entries: Sequence[CatalogueEntry], data_folder: Path | None) -> None:
    """Print motions and which of their files are there."""
    table = Table(title="motions", title_justify="left")
    for heading in ("name", "file", "frames", "rows", "sample", "licence", "there"):
        table.add_column(heading)
    for entry in entries:
        frames = f"{entry.frames.start} to {'last' if entry.frames.end == -1 else entry.frames.end}"
        there = "yes" if entry.is_there(data_folder) else "no"
        sample = "yes" if entry.sample else ""
        table.add_row(entry.name, entry.file, frames, str(entry.length), sample, entry.licence, there)
    output = console()
    output.print(table)
    for entry in entries:
        if entry.description:
            output.print(f"{entry.name}: {entry.description}", highlight=False, soft_wrap=True)
    if data_folder is None:
        output.print("No folder of source clips: name it with --data or in KINE2GO_DATA.")


def print_file_states(entries: Sequence[CatalogueEntry], states: Sequence["FileState"]) -> None:
    """Print whether each motion's file can be used."""
    table = Table(title="source files", title_justify="left")
    for heading in ("name", "file", "state"):
        table.add_column(heading)
    for entry, state in zip(entries, states, strict=True):
        table.add_row(entry.name, state.file, state.state)
    console().print(table)
