"""Tables of results on standard output."""

import importlib.metadata
import math
import platform
import textwrap
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rich.table import Table as RichTable
from rich.text import Text

from kine2go_warp.cli.texts import command_prefix, printable, say
from kine2go_warp.device import driver_too_old, start_warp
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.motions.catalogue_entry import CatalogueEntry
from kine2go_warp.motions.cycle_search import CycleCandidate
from kine2go_warp.motions.poses import Poses
from kine2go_warp.tables import Cell, Column, Table, known, make_table

if TYPE_CHECKING:
    from kine2go_warp.bench.measurement import BenchReport
    from kine2go_warp.dataset.summary import MotionSummary
    from kine2go_warp.motions.fetch import FileState
    from kine2go_warp.motions.fidelity import Fidelity
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


class PlainConsole(Console):
    """A console whose closed output is an error like that of ``print``, not an exit with a status of its own."""

    def on_broken_pipe(self) -> None:
        """Raise the error that rich has caught."""
        raise BrokenPipeError


def console() -> Console:
    """Return a console that does not fold tables when the output is piped."""
    output = PlainConsole()
    return output if output.is_terminal else PlainConsole(width=140)


FOLDED = 24
"""Columns of texts are folded to this width where a terminal is narrow."""


def print_table(table: Table, output: Console | None = None) -> None:
    """Print a table; where the terminal is too narrow for it, print a block of lines for each row.

    Numbers, names and dates are never cut, and nothing in a title or cell is taken for rich's markup.
    """
    output = output or console()
    if table.title:
        output.print(Text(printable(table.title), "italic"), soft_wrap=True)
    rows = [
        tuple(replace(cell, text=printable(cell.text)) for cell in row) for row in (*table.rows, table.total) if row
    ]
    columns = [replace(column, text=printable(column.text)) for column in table.columns]
    widths = [max([0, *(len(row[place].text) for row in rows)]) for place in range(len(columns))]
    least = [
        max([width if column.number else min(width, FOLDED), *map(len, column.heading.split())])
        for width, column in zip(widths, columns, strict=True)
    ]
    if sum(least) + 3 * len(least) + 1 > output.width:
        _print_blocks(columns, rows, output)
        return
    made = RichTable()
    for column, width in zip(columns, least, strict=True):
        heading = "\n".join(textwrap.wrap(column.heading, width, break_long_words=False, break_on_hyphens=False))
        side = "right" if column.number else "left"
        made.add_column(Text(heading), justify=side, no_wrap=column.number, min_width=width, overflow="fold")
    for row in rows:
        made.add_row(*(Text(one.text, one.style) for one in row), end_section=row is rows[-1] and bool(table.total))
    output.print(made)


def _print_blocks(columns: Sequence[Column], rows: Sequence[tuple[Cell, ...]], output: Console) -> None:
    """Print a table as blocks: the first cell of a row, then a line for each of the others that is not empty."""
    for row in rows:
        output.print(Text(row[0].text, "bold"), soft_wrap=True)
        for column, cell in zip(columns[1:], row[1:], strict=True):
            if cell.text:
                output.print(Text(f"  {column.heading}: ").append(cell.text, cell.style), soft_wrap=True)


def print_summaries(summaries: Sequence["MotionSummary"], dataset: Path, recordings: Path | None = None) -> None:
    """Print what a dataset holds, computed from the data written."""
    headings = ("joint RMSE [rad]", "root error [cm]", "root angle [rad]", "foot error [cm]")
    rows = [
        (
            row.motion,
            f"{row.accepted}/{row.total}",
            str(row.rejected_in_review),
            f"{row.shortest:.1f}" if row.shortest == row.longest else f"{row.shortest:.1f}-{row.longest:.1f}",
            f"{row.joint_rmse:.3f}",
            f"{100.0 * row.root_error:.1f}",
            f"{row.root_angle:.3f}",
            f"{100.0 * row.foot_error:.1f}",
        )
        for row in summaries
    ]
    columns = ("motion", "accepted", "rejected in review", "duration [s]", *headings)
    print_table(make_table(f"{dataset} (computed from the data written)", columns, rows, ("motion",)))
    if recordings is not None:
        for row in summaries:
            path = recordings / f"{row.motion}.rrd"
            if path.is_file():
                say(f"look at it: {command_prefix()}rerun {path}")


def print_rejections(result: "GatherResult") -> None:
    """Print why rollouts were rejected, which ones are worth a look, and how fast they were gathered."""
    if result.rejected:
        rows = [(reason, str(count)) for reason, count in sorted(result.rejected.items(), key=lambda item: -item[1])]
        print_table(make_table(f"{result.motion}: rejected rollouts", ("reason", "rollouts"), rows, ("reason",)))
    if result.borderline:
        numbers = ", ".join(str(number) for number in result.borderline)
        say(f"{result.motion}: worth a look, those closest to a limit first: {numbers}")
    if result.is_new:
        say(
            f"{result.motion}: {result.rows_per_second:,.0f} rows/s and {result.megabytes_per_second:.1f} MB/s while "
            f"simulating, {100.0 * result.waiting_share:.1f} % of it waiting for the disk; dataset written in "
            f"{result.write_time:.1f} s"
        )


def print_distributions(motion: str, distributions: "Sequence[Distribution]", attributes: dict[str, Any]) -> None:
    """Print the metrics of a motion's rollouts, why rollouts were rejected, and which ones are worth a look."""
    rows = []
    for one in distributions:
        values = (one.quantile(0.5), one.quantile(0.9), one.quantile(1.0), one.limit)
        rows.append((one.name, one.unit, *(f"{value:.4g}" for value in values)))
    headings, texts = ("metric", "unit", "median", "90 %", "largest", "limit"), ("metric", "unit")
    print_table(make_table(f"{motion}: {len(distributions[0].accepted)} accepted rollouts", headings, rows, texts))
    rejected = ", ".join(f"{count} {reason}" for reason, count in attributes.get("rejected", {}).items())
    say(f"rejected: {rejected or 'none'}")
    borderline = ", ".join(str(number) for number in attributes.get("borderline", ()))
    say(f"worth a look, those closest to a limit first: {borderline or 'none'}")


def print_replays(results: "Sequence[tuple[str, str, list[ReplayResult]]]", engine: str) -> None:
    """Print how replays compare with the record."""
    from kine2go_warp.rollouts.replay import HORIZONS

    times = (*(f"{horizon} s" for horizon in HORIZONS), "to the end")
    rows = []
    for motion, device, found in results:
        for one in found:
            same = "all" if one.first_difference is None else f"before row {one.first_difference}"
            differences = (
                known(f"{1e3 * root:.3g} / {1e3 * joint:.3g}")
                for root, joint in zip(one.root_difference, one.joint_difference, strict=True)
            )
            rows.append((motion, device, str(one.trajectory), str(one.num_rows), same, *differences))
    title = f"replay in {engine}: largest differences of root [mm] and joints [mrad] within a time"
    headings = ("motion", "device", "trajectory", "rows", "same bits", *times)
    print_table(make_table(title, headings, rows, ("motion", "device")))


def depths(fidelity: "Fidelity") -> list[float]:
    """Return how deep feet are below the floor in the source, where that has feet of a known size, and in the clip."""
    return [depth for depth in (fidelity.source_penetration, fidelity.penetration) if not math.isnan(depth)]


def print_clips(qualities: Sequence["ClipQuality"], remarks: dict[str, list[str]], folder: Path) -> None:
    """Print the metrics of retargeted clips."""
    headings = (
        *("clip", "frames", "period", "speed", "pitch", "swings", "duty", "height", "seam", "slip"),
        *("standing feet before and after", "depth", "remarks"),
    )
    rows = []
    for row in qualities:
        metrics = (
            f"{row.start}-{row.end}",
            f"{row.period:.2f} s",
            f"{row.speed:.2f} m/s",
            f"{row.fidelity.trunk_pitch:+.1f} deg",
            f"{row.fidelity.swing_front:.2f} {row.fidelity.swing_hind:.2f}",
            f"{row.fidelity.duty:+.3f}",
            f"r {row.fidelity.height_correlation:.2f}",
            f"{row.fidelity.seam_acceleration:.1f} m/s^2",
            f"{row.fidelity.contact_slip:.3f} m/s",
            f"{row.fidelity.source_standing_speed:.2f} {row.fidelity.standing_speed:.2f} m/s",
            " ".join(f"{1e3 * depth:.0f}" for depth in depths(row.fidelity)) + " mm",
        )
        rows.append((row.name, *map(known, metrics), "; ".join(remarks[row.name])))
    print_table(make_table(str(folder), headings, rows, ("clip", "remarks")))


def print_cycles(found: Sequence[CycleCandidate], rate: float, targets: Poses, file: Path) -> None:
    """Print the best ranges of a motion."""
    rows = []
    for one in found:
        way = np.linalg.norm(targets.root_position[one.end, :2] - targets.root_position[one.start, :2])
        frames = one.end - one.start
        rows.append(
            (str(one.start), str(one.end), str(frames), f"{frames / rate:.2f} s", f"{way:.2f} m", f"{one.score:.2f}")
        )
    print_table(make_table(f"{file}: best cycles", ("start", "end", "frames", "duration", "way", "seam score"), rows))


def print_bench(report: "BenchReport") -> None:
    """Print what a benchmark has found, and where."""
    from kine2go_warp.machine import machine

    settings = ", ".join(
        f"{name} {value}" if isinstance(value, str) else f"{value:,} {name}" for name, value in report.settings.items()
    )
    rows = []
    for row in report.measurements:
        values = (f"{value:,.0f}" if value >= 100.0 else f"{value:.3f}" for value in (row.median, *row.spread))
        rows.append((row.name, *values, row.unit, row.note))
    headings, texts = ("figure", "median", "lowest", "highest", "unit", "what it is"), ("figure", "unit", "what it is")
    if not any(row.note for row in report.measurements):
        headings, rows = headings[:-1], [row[:-1] for row in rows]
    print_table(make_table(f"{report.stage} on {report.device}: {settings}", headings, rows, texts))
    say(", ".join(f"{name} {value}" for name, value in machine(report.device).items()))


def print_machine() -> list[str]:
    """Print versions and devices, and return what is wrong with them."""
    import warp as wp

    rows, problems = [("Python", platform.python_version())], []
    for package in PACKAGES:
        try:
            rows.append((package, importlib.metadata.version(package)))
        except importlib.metadata.PackageNotFoundError:
            rows.append((package, "missing"))
            problems.append(f"{package} is not installed")
    try:
        start_warp()
        rows += [(f"device {device.alias}", device.name) for device in wp.get_devices()]
        rows.append(("used by default", "cuda:0" if wp.is_cuda_available() else "cpu"))
        rows.append(("kernel cache", str(wp.config.kernel_cache_dir)))
        if too_old := driver_too_old():
            problems.append(too_old)
    except Kine2GoError as error:
        problems.append(str(error))
    print_table(make_table("software and devices", ("what", "version or name"), rows, ("what", "version or name")))
    return problems


def print_usable(entries: Sequence[CatalogueEntry], data_folder: Path | None) -> None:
    """Print which motions can be used here."""
    names = [entry.name for entry in entries if entry.is_there(data_folder)]
    say(f"motions that can be used here: {len(names)} of {len(entries)}: {', '.join(names) or 'none'}")
    if len(names) < len(entries):
        more = "" if data_folder else "; name the folder of source clips with --data or in KINE2GO_DATA"
        say(f"'kine2go motion sources list' shows the others and their files{more}")


def print_motions(entries: Sequence[CatalogueEntry], data_folder: Path | None) -> None:
    """Print motions and which of their files are there."""
    headings = ("name", "file", "frames", "rows", "sample", "licence", "there")
    rows = []
    for entry in entries:
        frames = f"{entry.frames.start} to {'last' if entry.frames.end == -1 else entry.frames.end}"
        there = "yes" if entry.is_there(data_folder) else "no"
        sample = "yes" if entry.sample else ""
        rows.append((entry.name, entry.file, frames, str(entry.length), sample, entry.licence, there))
    print_table(make_table("motions", headings, rows, ("name", "file", "frames", "sample", "licence", "there")))
    for entry in entries:
        if entry.description:
            say(f"{entry.name}: {entry.description}")
    if data_folder is None:
        say("No folder of source clips: name it with --data or in KINE2GO_DATA.")


def print_file_states(entries: Sequence[CatalogueEntry], states: Sequence["FileState"]) -> None:
    """Print whether each motion's file can be used."""
    rows = [(entry.name, state.file, state.state) for entry, state in zip(entries, states, strict=True)]
    print_table(make_table("source files", ("name", "file", "state"), rows, ("name", "file", "state")))
