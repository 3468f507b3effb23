"""Tables of results on standard output."""

import importlib.metadata
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.table import Table

from kine2go_warp.motions.catalogue import load_catalogue
from kine2go_warp.motions.clip import MotionClip

if TYPE_CHECKING:
    from kine2go_warp.dataset.summary import MotionSummary

PACKAGES = ("kine2go-warp", "newton", "warp-lang", "mujoco-warp", "torch", "rsl-rl-lib", "placo", "zarr", "rerun-sdk")


def console() -> Console:
    """Return a console that does not fold tables when the output is piped."""
    output = Console()
    return output if output.is_terminal else Console(width=140)


def print_summaries(summaries: Sequence["MotionSummary"], dataset: Path, recordings: Path | None = None) -> None:
    """Print what a dataset holds, computed from the data written."""
    table = Table(title=f"{dataset} (figures computed from the data written)", title_justify="left")
    for heading in ("motion", "accepted", "duration", "joint RMSE", "root error", "root angle", "foot error"):
        table.add_column(heading, justify="left" if heading == "motion" else "right")
    for row in summaries:
        table.add_row(
            row.motion,
            f"{row.accepted}/{row.total}",
            f"{row.shortest:.1f} s" if row.shortest == row.longest else f"{row.shortest:.1f}-{row.longest:.1f} s",
            f"{row.joint_rmse:.3f} rad",
            f"{100.0 * row.root_error:.1f} cm",
            f"{row.root_angle:.3f} rad",
            f"{100.0 * row.foot_error:.1f} cm",
        )
    output = console()
    output.print(table)
    if recordings is not None:
        for row in summaries:
            path = recordings / f"{row.motion}.rrd"
            if path.is_file():
                output.print(f"look at it: rerun {path}", highlight=False, soft_wrap=True)


def print_clips(clips: Sequence[MotionClip], folder: Path) -> None:
    """Print what was retargeted."""
    table = Table(title=str(folder), title_justify="left")
    for heading in ("clip", "frames", "period", "speed", "turn a cycle", "IK residual", "joint speed"):
        table.add_column(heading, justify="left" if heading == "clip" else "right")
    for clip in clips:
        speed = float(np.linalg.norm(clip.root_linear_velocity[:, :2], axis=1).mean())
        table.add_row(
            clip.name,
            str(clip.num_frames),
            f"{clip.period:.2f} s",
            f"{speed:.2f} m/s",
            f"{clip.cycle.yaw:.2f} rad",
            f"{1e3 * clip.residual.max():.2f} mm",
            f"{np.abs(clip.joint_velocity).max():.1f} rad/s",
        )
    console().print(table)


def print_machine() -> None:
    """Print versions and devices."""
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR
    wp.init()
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


def print_motions(data_folder: Path | None) -> None:
    """Print the catalogue and which of its files are there."""
    table = Table(title="motions", title_justify="left")
    for heading in ("name", "file", "frames", "licence", "there"):
        table.add_column(heading)
    for entry in load_catalogue().values():
        there = entry.is_there(data_folder)
        frames = f"{entry.frames.start} to {'last' if entry.frames.end == -1 else entry.frames.end}"
        table.add_row(entry.name, entry.file, frames, entry.licence, "yes" if there else "no")
    output = console()
    output.print(table)
    if data_folder is None:
        output.print("No folder of source clips: name it with --data or in KINE2GO_DATA.")
