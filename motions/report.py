"""Reports on reference clips: JSON for machines, a table for documents, a picture for people."""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from kine2go_warp.files import atomic_file
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.motions.fidelity import Fidelity
from kine2go_warp.motions.keypoints import BONES, KEYPOINTS, KeypointMotion
from kine2go_warp.motions.quality import ClipQuality
from kine2go_warp.quantities import LEG_NAMES
from kine2go_warp.robots import RobotSpec
from kine2go_warp.robots.spec import LEG_JOINTS
from kine2go_warp.tables import Cell, known, make_table, markdown

COLOURS = ("#d1495b", "#3066be", "#edae49", "#2a9d8f")
"""Front left, front right, rear left, rear right."""


def write_json(qualities: Sequence[ClipQuality], remarks: dict[str, list[str]], path: Path) -> None:
    """Write all figures, beside those of other clips that are in the file already."""
    known = {}
    if path.is_file():
        try:
            known = {row["name"]: row for row in json.loads(path.read_text())}
        except (ValueError, TypeError, KeyError):
            known = {}
    for quality in qualities:
        row = {**asdict(quality), "fidelity": quality.fidelity.as_json(), "remarks": remarks[quality.name]}
        known[quality.name] = row
    content = [known[name] for name in sorted(known)]
    with atomic_file(path) as temporary:
        temporary.write_text(json.dumps(content, indent=2) + "\n")


COLUMNS: tuple[tuple[str, Callable[[ClipQuality], str]], ...] = (
    ("frames", lambda q: f"{q.start}-{q.end}"),
    ("period [s]", lambda q: f"{q.period:.2f}"),
    ("speed [m/s]", lambda q: f"{q.speed:.2f}"),
    ("trunk pitch [deg]", lambda q: f"{q.fidelity.trunk_pitch:+.1f}"),
    ("swing height kept, front", lambda q: f"{q.fidelity.swing_front:.2f}"),
    ("hind", lambda q: f"{q.fidelity.swing_hind:.2f}"),
    ("duty", lambda q: f"{q.fidelity.duty:+.3f}"),
    ("base height r", lambda q: f"{q.fidelity.height_correlation:.2f}"),
    ("dip [mm]", lambda q: f"{1e3 * q.fidelity.base_dip:.0f}"),
    ("seam [m/s^2]", lambda q: f"{q.fidelity.seam_acceleration:.1f}"),
    ("elsewhere", lambda q: f"{q.fidelity.other_acceleration:.1f}"),
    ("animal", lambda q: f"{q.fidelity.animal_acceleration:.1f}"),
    ("seam, strides", lambda q: f"{q.fidelity.seam_shift:.2f}"),
    ("seam score", lambda q: "" if q.seam_score is None else f"{q.seam_score:.2f}"),
    ("slip [m/s]", lambda q: f"{q.fidelity.contact_slip:.3f}"),
    ("95 %", lambda q: f"{q.fidelity.contact_slip_95:.2f}"),
    ("standing feet, source [m/s]", lambda q: f"{q.fidelity.source_standing_speed:.2f}"),
    ("clip", lambda q: f"{q.fidelity.standing_speed:.2f}"),
    ("penetration, source [mm]", lambda q: f"{1e3 * q.fidelity.source_penetration:.0f}"),
    ("penetration [mm]", lambda q: f"{1e3 * q.penetration:.2f}"),
    ("knee bent [rad]", lambda q: f"{q.fidelity.knee_bent_margin:.2f}"),
    ("straight", lambda q: f"{q.fidelity.knee_straight_margin:.2f}"),
    ("joint limits [rad]", lambda q: f"{q.joint_margin:.2f}"),
    ("joint speed", lambda q: f"{q.speed_share:.2f}"),
    ("above 15 Hz [%]", lambda q: f"{100.0 * q.fidelity.high_frequency:.2f}"),
    ("flight [m/s^2]", lambda q: f"{q.fidelity.flight_acceleration:.1f}"),
    ("residual [mm]", lambda q: f"{1e3 * q.residual:.2f}"),
    ("feet moved to reach [mm]", lambda q: f"{1e3 * q.foot_moved:.0f}"),
    ("path length [%]", lambda q: f"{100.0 * q.path_error:+.1f}"),
)
"""Headings of the table after the motion, and how each cell is written."""


def markdown_table(qualities: Sequence[ClipQuality], remarks: dict[str, list[str]]) -> str:
    """Return all figures as a table in Markdown."""
    headings = ("motion", *(heading for heading, _ in COLUMNS), "remarks")
    rows = [
        [Cell(one.name, code=True), *(known(cell(one)) for _, cell in COLUMNS), "; ".join(remarks[one.name])]
        for one in qualities
    ]
    return markdown(make_table("", headings, rows))


def described(fidelity: Fidelity | None) -> str:
    """Return the most telling metrics in a line."""
    if fidelity is None:
        return ""
    metrics = (
        f"trunk pitch {fidelity.trunk_pitch:+.1f} deg",
        f"swing height {fidelity.swing_front:.2f} front and {fidelity.swing_hind:.2f} hind",
        f"duty {fidelity.duty:+.3f}",
        f"base height r {fidelity.height_correlation:.2f}",
        f"seam {fidelity.seam_acceleration:.1f} m/s$^2$ (elsewhere {fidelity.other_acceleration:.1f})",
        f"slip {fidelity.contact_slip:.3f} m/s",
    )
    return ", ".join(filter(known, metrics))


def draw_sheet(clip: MotionClip, spec: RobotSpec, path: Path) -> None:
    """Draw a clip on one page: foot heights with stance bars, joints against their limits, the path from above."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 8), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(f"{clip.name}: {clip.num_frames} frames, {clip.period:.2f} s\n{described(clip.fidelity)}")
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


def draw_motion(motion: KeypointMotion, title: str, path: Path) -> None:
    """Draw the animal of a file: its skeleton at some moments from the side, its way from above, its toes over time."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 8), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title)
    side, above, heights = figure.subplots(3, 1)
    forward = np.median(motion.point("neck") - motion.point("pelvis"), axis=0)[:2]
    forward /= max(np.linalg.norm(forward), 1e-9)
    for index, frame in enumerate(np.linspace(0, motion.num_frames - 1, 8).round().astype(int)):
        points = motion.position[frame] - motion.position[frame, 0] * [1.0, 1.0, 0.0]
        along = points[:, :2] @ forward + 1.8 * index * motion.trunk_length
        for first, second in BONES:
            leg = KEYPOINTS[second][:2]
            colour = COLOURS[LEG_NAMES.index(leg)] if leg in LEG_NAMES else "black"
            side.plot(along[[first, second]], points[[first, second], 2], color=colour)
    side.set(ylabel="height [m]", aspect="equal", title="eight moments from its right")
    for leg, colour in zip(LEG_NAMES, COLOURS, strict=True):
        toe = motion.point(f"{leg}_toe")
        above.plot(*toe[:, :2].T, color=colour, linewidth=0.7, label=leg)
        heights.plot(motion.time, toe[:, 2], color=colour, linewidth=0.7)
    above.plot(*motion.point("pelvis")[:, :2].T, color="black")
    above.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", title="from above: pelvis (black) and toes")
    above.legend(ncols=4, fontsize="small")
    heights.set(xlabel="time [s]", ylabel="height of toes [m]")
    with atomic_file(path) as temporary:
        figure.savefig(temporary, dpi=80)
