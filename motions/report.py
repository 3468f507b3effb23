"""Reports on reference clips: JSON for machines, a table for documents, a picture for people."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from kine2go_warp.files import atomic_file
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.motions.quality import ClipQuality
from kine2go_warp.robots import RobotSpec
from kine2go_warp.robots.spec import LEG_JOINTS

COLOURS = ("#d1495b", "#3066be", "#edae49", "#2a9d8f")
"""Front left, front right, rear left, rear right."""


def write_json(qualities: Sequence[ClipQuality], faults: dict[str, list[str]], path: Path) -> None:
    """Write all figures."""
    content = [{**asdict(quality), "faults": faults[quality.name]} for quality in qualities]
    with atomic_file(path) as temporary:
        temporary.write_text(json.dumps(content, indent=2) + "\n")


def markdown_table(qualities: Sequence[ClipQuality], faults: dict[str, list[str]]) -> str:
    """Return all figures as a table in Markdown."""
    lines = [
        "| motion | frames | period [s] | residual [mm] | penetration [mm] | stance slip [m/s] | swing height [cm] | "
        "joint margin [rad] | joint speed [share] | seam, mean steps | seam, steps beside | speed [m/s] | "
        "path length | remarks |",
        "|---|" + "---:|" * 12 + "---|",
    ]
    lines += [
        f"| `{q.name}` | {q.start}-{q.end} | {q.period:.2f} | {1e3 * q.residual:.2f} | {1e3 * q.penetration:.2f} | "
        f"{q.stance_slip:.3f} | {100.0 * q.swing_clearance:.1f} | {q.joint_margin:.2f} | {q.speed_share:.2f} | "
        f"{q.seam_jump:.2f} | {q.seam_step:.2f} | {q.speed:.2f} | {100.0 * q.path_error:+.1f} % | "
        f"{'; '.join(faults[q.name]) or ''} |"
        for q in qualities
    ]
    return "\n".join(lines) + "\n"


def draw_sheet(clip: MotionClip, spec: RobotSpec, path: Path) -> None:
    """Draw a clip on one page: foot heights with stance bars, joints against their limits, the path from above."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 8), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(f"{clip.name}: {clip.num_frames} frames, {clip.period:.2f} s")
    grid = figure.add_gridspec(3, 2)
    time = np.arange(clip.num_frames) * clip.frame_duration
    heights = figure.add_subplot(grid[0, 0])
    stance = figure.add_subplot(grid[1, 0], sharex=heights)
    path_view = figure.add_subplot(grid[2, 0])
    for foot, leg in enumerate(spec.legs):
        colour = COLOURS[foot]
        height = 100.0 * (clip.foot_position[:, foot, 2] - spec.foot_radius)
        heights.plot(time, height, color=colour, label=leg.name)
        stance.fill_between(time, foot - 0.4, foot + 0.4, where=clip.stance[:, foot] > 0.5, step="mid", color=colour)
        path_view.plot(*clip.foot_position[:, foot, :2].T, color=colour, linewidth=0.7)
    path_view.plot(*clip.root_position[:, :2].T, color="black")
    path_view.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", title="from above: base (black) and feet")
    heights.set(ylabel="foot height [cm]", xlabel="time [s]")
    heights.axhline(0.0, color="grey", linewidth=0.5)
    heights.legend(ncols=4, fontsize="small")
    names = [leg.name for leg in spec.legs]
    stance.set(yticks=range(4), yticklabels=names, ylabel="stance", xlabel="time [s]")
    for row, joint in enumerate(LEG_JOINTS):
        axes = figure.add_subplot(grid[row, 1])
        for foot in range(4):
            axes.plot(time, clip.joint_position[:, 3 * foot + row], color=COLOURS[foot])
        for limits in (spec.joint_lower, spec.joint_upper):
            for foot in (0, 2):
                axes.axhline(limits[3 * foot + row], color="grey", linestyle=":", linewidth=0.8)
        axes.set(ylabel=f"{joint} [rad]", xlabel="time [s]")
    with atomic_file(path) as temporary:
        figure.savefig(temporary, dpi=80)
