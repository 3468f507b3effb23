"""Puts the page together from a dataset."""

import platform
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from kine2go_warp import __version__
from kine2go_warp.dataset import Dataset, open_dataset
from kine2go_warp.errors import RenderError
from kine2go_warp.files import atomic_file
from kine2go_warp.renders.process import RenderProcess
from kine2go_warp.renders.video import check_output
from kine2go_warp.reports import tables
from kine2go_warp.reports.limits import LimitShare, limit_shares, limits_table
from kine2go_warp.reports.plots import MOST_PATHS, coverage_svg, phase_svg
from kine2go_warp.reports.thumbnails import HEIGHT, WIDTH, Strip, strips
from kine2go_warp.revision import revision
from kine2go_warp.scores.plots import compute_curves
from kine2go_warp.scores.report import MotionMetrics, measure, review_note, robot_note, score, scored_motions
from kine2go_warp.tables import number_text

PAGE = Path(__file__).parent / "page"
"""Template, style and script."""

FEW = 3
"""The parts of more motions than this are folded at first."""

DATASET_FACTS = {
    "format_version": "",
    "software_version": "",
    "software_revision": "",
    "robot": "",
    "robot_model_sha256": "",
    "control_frequency": "Hz",
    "physics_substeps": "",
    "stiffness": "N m/rad",
    "damping": "N m s/rad",
    "action_scale": "rad",
}
"""Attributes of the store that are shown, with their units."""


@dataclass(frozen=True)
class MotionPart:
    """What the page shows of one motion."""

    name: str
    rows: int
    duration: float
    """Of all trajectories together [s]."""
    attributes: dict[str, Any]
    metrics: MotionMetrics
    coverage: str
    """A drawing as SVG."""
    phase: str
    """A drawing as SVG."""
    limits: tuple[LimitShare, ...]
    """Closest first."""
    strips: tuple[Strip, ...]
    note: str
    """Why there are no pictures, if there are none."""

    @property
    def trajectories(self) -> int:
        """How many it has."""
        return self.metrics.trajectories


def default_path(dataset: Path) -> Path:
    """Return where the page of a dataset goes: beside it."""
    resolved = dataset.resolve()
    return dataset.parent / f"{resolved.stem}_report.html"


def write_report(
    dataset: Path,
    path: Path,
    motions: Sequence[str] = (),
    pictures: bool = True,
    overwrite: bool = False,
    advanced: Callable[[int, int, str], None] | None = None,
) -> list[MotionPart]:
    """Write a page that needs nothing but itself.

    Args:
        dataset: Folder of the dataset.
        path: File to write.
        motions: Names of motions; by default all.
        pictures: Whether to draw thumbnails.
        overwrite: Whether a file that is there may be replaced.
        advanced: Called before each motion with the number of motions done, that of all, and the name.

    Returns:
        What the page shows.

    Raises:
        RenderError: the file cannot be written, or a motion holds nothing.
        DatasetError: the dataset cannot be read.
    """
    if path.suffix.lower() not in (".html", ".htm"):
        raise RenderError(f"{path}: a report ends in .html, not '{path.suffix}'")
    opened = open_dataset(dataset)
    names = scored_motions(opened, motions)
    check_output(path, overwrite)
    parts = []
    with ExitStack() as stack:
        renderer, note = (
            open_renderer(stack, opened.robot.reference) if pictures else (None, "Pictures were not asked for.")
        )
        for number, name in enumerate(names):
            if advanced is not None:
                advanced(number, len(names), name)
            parts.append(motion_part(opened, name, f"m{number}", renderer, note))
    with atomic_file(path) as temporary:
        temporary.write_text(page(opened, parts, review_note(opened, motions)), encoding="utf-8")
    return parts


def open_renderer(stack: ExitStack, robot: str) -> tuple[RenderProcess | None, str]:
    """Return what draws thumbnails, or why there is nothing that could."""
    try:
        return stack.enter_context(RenderProcess(WIDTH, HEIGHT, robot)), ""
    except RenderError as error:
        return None, f"No pictures: {error}."


def motion_part(dataset: Dataset, name: str, key: str, renderer: RenderProcess | None, note: str) -> MotionPart:
    """Compute and draw everything of one motion.

    Raises:
        RenderError: it holds nothing that could be shown, or poses that are not finite.
        DatasetError: it cannot be read.
    """
    check_content(dataset, name)
    data = dataset.load(name)
    metrics, curves = measure(data, dataset.robot), compute_curves(data)
    shown: tuple[Strip, ...] = ()
    if renderer is not None:
        shown = strips(renderer, dataset.motion(name), metrics.metrics["joint_rmse"], data.indices)
    duration = metrics.rows * data.frame_duration
    return MotionPart(
        name, metrics.rows, duration, data.attributes, metrics, coverage_svg(curves, f"{key}c"),
        phase_svg(curves, f"{key}p"), limit_shares(data), shown, note,
    )  # fmt: skip


def check_content(dataset: Dataset, name: str) -> None:
    """Check that every trajectory of a motion has a row, and that there is one.

    Raises:
        RenderError: there is nothing to show.
    """
    motion = dataset.motion(name)
    if len(motion.time) < 2 or not len(motion.lengths) or motion.lengths.min() < 1:
        raise RenderError(f"{dataset.path}/{name}: holds no trajectory, or an empty one; see 'kine2go dataset check'")


def page(dataset: Dataset, parts: Sequence[MotionPart], review: str) -> str:
    """Return the page as HTML; all texts of the dataset are escaped.

    Args:
        dataset: The dataset.
        parts: Its motions.
        review: How many trajectories are left out because a review rejected them, empty if none is.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    scores = score([part.metrics for part in parts])
    attributes = {part.name: part.attributes for part in parts}
    shared, different = tables.settings(attributes)
    environment = Environment(
        loader=FileSystemLoader(PAGE), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.get_template("page.html.j2").render(
        name=dataset.path.resolve().name,
        parts=parts,
        scorecard=tables.scorecard(
            scores.motions, {part.name: (part.trajectories, part.duration) for part in parts}, scores.overall
        ),
        metrics={part.name: tables.all_metrics(scores.motions[part.name]) for part in parts},
        limits={part.name: limits_table(part.limits) for part in parts},
        longest=max(part.duration for part in parts),
        folded=len(parts) > FEW,
        made=made_when_and_where(dataset),
        fidelity={part.name: tables.fidelity(part.attributes) for part in parts},
        rejections=tables.rejections(attributes, {part.name: part.trajectories for part in parts}),
        licences=tables.licences(attributes),
        shared=shared,
        different=different,
        facts=tables.facts(dataset.attributes, DATASET_FACTS),
        tiles=tiles(parts, scores.overall["acceptance"].value),
        robot_note=robot_note(dataset, dataset.robot),
        review_note=review,
        note=next((part.note for part in parts if part.note), ""),
        most_paths=MOST_PATHS,
        made_by=f"kine2go_warp {__version__}" + (f", revision {revision()}" if revision() else ""),
        number_text=number_text,
        style=(PAGE / "page.css").read_text(),
        script=(PAGE / "page.js").read_text(),
    )


def made_when_and_where(dataset: Dataset) -> str:
    """Return when the dataset was changed last, and where it is."""
    path = dataset.path.resolve()
    when = datetime.fromtimestamp((path / "zarr.json").stat().st_mtime, UTC)
    return f"Data of {when:%Y-%m-%d %H:%M} UTC, at {path} on {platform.node()}"


def tiles(parts: Sequence[MotionPart], acceptance: float) -> list[tuple[str, str]]:
    """Return the few numbers at the top, as text and what they count."""
    rows = sum(part.rows for part in parts)
    trajectories = sum(part.trajectories for part in parts)
    minutes = sum(part.duration for part in parts) / 60.0
    return [
        (f"{len(parts)}", "motion" if len(parts) == 1 else "motions"),
        (f"{trajectories:,}", "trajectory" if trajectories == 1 else "trajectories"),
        (f"{rows:,}", "rows"),
        (f"{minutes:.1f}" if minutes < 600.0 else f"{minutes / 60.0:,.1f}", "minutes" if minutes < 600.0 else "hours"),
        (f"{100.0 * acceptance:.3g} %", "accepted"),
    ]
