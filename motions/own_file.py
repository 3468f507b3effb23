"""Motion files that are not in a catalogue: which source reads them, and a table for a catalogue of one's own."""

import json
import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.errors import CatalogueError, ClipError
from kine2go_warp.motions.catalogue import DEFAULT_LENGTH
from kine2go_warp.motions.catalogue_entry import CatalogueEntry
from kine2go_warp.motions.clip import Kind
from kine2go_warp.motions.config import LEAST_WAY
from kine2go_warp.motions.cycle_search import CycleCandidate, cycle_frames, find_cycles
from kine2go_warp.motions.examination import UNITS
from kine2go_warp.motions.keypoints import KEYPOINTS, FrameRange, KeypointMotion
from kine2go_warp.motions.proportions import measured_proportions
from kine2go_warp.motions.sources import SOURCES, MotionSource, source_named, source_of
from kine2go_warp.motions.sources.dialects import Dialect, PointFormat, PointsDialect, parse_dialects
from kine2go_warp.motions.sources.joints import JointSource
from kine2go_warp.motions.sources.points import PointSource, read_points, with_z_up
from kine2go_warp.motions.sources.recognition import candidates, guessed_points, recognise
from kine2go_warp.motions.targets import pose_targets
from kine2go_warp.names import check_name
from kine2go_warp.robots import RobotSpec
from kine2go_warp.toml import read_toml

Array = NDArray[np.float64]

USUAL_HIP_HEIGHT = 0.5
"""Between a cat's and a horse's [m], to tell units by."""
TRUNK_OF_GO2 = 0.3
"""A trunk of the size of the robot, before its proportions are measured [m]."""


@dataclass(frozen=True)
class OwnFile:
    """A motion file that is not in a catalogue, and its settings."""

    path: Path
    """The file; ``file.pt:K`` where its source wants that."""
    licence: str
    """Under which the motion may be used; it goes with the data that are made of it."""
    name: str = ""
    """Of the motion; by default that of the file."""
    source: str = ""
    """Name of the source that reads it, or ``FILE.py:NAME``; by default it is recognised."""
    frames: FrameRange = field(default_factory=FrameRange)
    rate: float = 0.0
    """Frames per second of a file that cannot tell its own [Hz]."""
    citation: str = ""
    kind: Kind = "cycle"
    """Whether its clip is repeated, or played once."""

    def entry(self, own: Path | None = None) -> CatalogueEntry:
        """Return the entry that a catalogue would have.

        Args:
            own: A catalogue whose sources are known besides the package's.

        Raises:
            ClipError: the file is missing, or no source reads it.
            CatalogueError: the name cannot be used, there is no such source, or no licence is told.
        """
        if not self.licence.strip():
            raise CatalogueError(
                f"{self.path}: state with --licence under which licence the motion may be used, as in "
                "--licence 'CC BY 4.0'; it goes with the data"
            )
        name = self.name or name_of(self.path)
        check_name(name, self.path, CatalogueError)
        reader = self.reader(own)
        is_own = SOURCES.get(reader.name) is not reader
        return CatalogueEntry(
            name=name,
            collection="",
            source=self.source or reader.name,
            file=self.path.name,
            frames=self.frames,
            rate=self.rate or reader.rate,
            length=DEFAULT_LENGTH,
            sample=False,
            bundled=False,
            licence=self.licence,
            citation=self.citation,
            folder=str(self.path.resolve().parent),
            dialect=reader.dialect if is_own and isinstance(reader, PointSource | JointSource) else None,
            kind=self.kind,
        )

    def reader(self, own: Path | None = None) -> MotionSource:
        """Return the source that reads the file; ``own`` as in ``entry``.

        Raises:
            ClipError: the file is missing, or no source reads it.
            CatalogueError: there is no such source.
        """
        sources = known_sources(own)
        if self.source:
            return sources[self.source] if self.source in sources else source_named(self.source)
        return recognise(self.path, sources, self.rate or None)[0]


def own_dialects(own: Path | None) -> dict[str, Dialect]:
    """Return the descriptions of sources in a user's own catalogue, by name.

    Raises:
        CatalogueError: the file is not there, or a field is missing, unknown or of another type.
    """
    return {} if own is None else parse_dialects(*read_toml(own, CatalogueError), str(own))


def known_sources(own: Path | None) -> dict[str, MotionSource]:
    """Return the package's sources and those of a user's own catalogue, by name; errors as of ``own_dialects``."""
    return SOURCES | {name: source_of(name, one) for name, one in own_dialects(own).items()}


def name_of(path: Path) -> str:
    """Return a name for the motion in a file."""
    return re.sub(r"[^A-Za-z0-9._-]+", "_", path.name.partition(".")[0]).strip("_.-")


@dataclass(frozen=True)
class Introduction:
    """What a file is taken for."""

    path: Path
    source: MotionSource
    motion: KeypointMotion
    is_new: bool
    """Whether its source is a guess about a file that no source recognises."""
    cycle: CycleCandidate | None
    """The range that repeats itself best, if one does."""

    def lines(self) -> list[tuple[str, str]]:
        """Return what a person should look through: what, and what it is taken to be."""
        motion, source = self.motion, self.source
        size = motion.points("hip")[..., 2].mean() - motion.points("toe")[..., 2].min(axis=0).mean()
        found = [
            ("source", f"{source.name} ({'a guess by names and measures' if self.is_new else 'recognised'})"),
            ("frames", f"{motion.num_frames} at {motion.rate:g} Hz, {motion.num_frames / motion.rate:.1f} s"),
            ("animal", f"hips {size:.2f} m high, trunk {motion.trunk_length:.2f} m long"),
            ("scale", f"{source.scale:.3g} to the Go2, base {1e3 * source.root_drop:.0f} mm below the trunk's middle"),
        ]
        if isinstance(source, PointSource):
            hand = "left-handed" if source.dialect.left_handed else "right-handed"
            found.insert(2, ("axes", f"{source.dialect.unit}, {source.dialect.up} up, {hand}"))
        if self.cycle is not None:
            found.append(("cycle", f"frames {self.cycle.start} to {self.cycle.end}, seam score {self.cycle.score:.2f}"))
        return [*found, *(("taken", note) for note in motion.notes), *(("repaired", one) for one in motion.remarks)]

    def toml(self, name: str) -> str:
        """Return a catalogue with this motion, to be edited."""
        lines = [f"# {self.path.name} as 'kine2go motion new' takes it: fill in the licence, correct the rest."]
        if self.is_new and isinstance(self.source, PointSource):
            lines += ["", *source_table(self.source.name, self.source.dialect)]
        start, end = (0, -1) if self.cycle is None else (self.cycle.start, self.cycle.end)
        file = OwnFile(
            Path(self.path.name),
            "",
            name,
            self.source.name,
            FrameRange(start, end),
            0.0 if self.source.tells_rate else self.motion.rate,
            kind="cycle" if self.cycle else "once",
        )
        lines += ["", *motion_table(file)]
        return "\n".join(lines) + "\n"


def motion_table(file: OwnFile, **more: object) -> list[str]:
    """Return the lines of the [[motion]] of a file with a name and a source, with more keys where they are stated."""
    once = {"kind": "once"} if file.kind == "once" else {}
    values = {
        "name": file.name,
        "file": str(file.path),
        "source": file.source,
        "start": file.frames.start,
        "end": file.frames.end,
        **once,
        "licence": file.licence,
        "citation": file.citation,
        **({"rate": file.rate} if file.rate else {}),
        **more,
    }
    notes = {"kind": "  # played from hold to hold; hold = 1.0 would hold its ends for 1 s"}
    if not file.licence:
        notes["licence"] = '  # as in "CC BY 4.0"; it goes with the data'
    return ["[[motion]]", *(f"{key} = {json.dumps(value)}{notes.get(key, '')}" for key, value in values.items())]


def source_table(name: str, dialect: PointsDialect) -> list[str]:
    """Return the lines of a [source.NAME]."""
    lines = [
        f"[source.{name}]",
        f"format = {json.dumps(dialect.format)}",
        f"unit = {json.dumps(dialect.unit)}",
        f"up = {json.dumps(dialect.up)}",
        f"left_handed = {json.dumps(dialect.left_handed)}",
        f"scale = {dialect.scale:.3g}  # size of the Go2 over that of the animal",
        f"root_drop = {dialect.root_drop:.3f}  # the base below the middle of pelvis and neck, after scaling [m]",
        f"forward_lift = {dialect.forward_lift:.3f}  # the neck below the trunk's axis [m]",
        f"foot_outward = {dialect.foot_outward:.3f}  # feet moved outwards [m]",
    ]
    if dialect.format == "table":
        lines.append(f"columns = {json.dumps(dialect.columns)}")
    if dialect.time:
        lines.append(f"time = {json.dumps(dialect.time)}")
    if dialect.rate:
        lines.append(f"rate = {dialect.rate:g}")
    return [*lines, f"[source.{name}.points]", *(f"{key} = {json.dumps(dialect.points[key])}" for key in KEYPOINTS)]


def introduce(file: OwnFile, spec: RobotSpec, own: Path | None = None) -> Introduction:
    """Look at a file and say what it is taken for.

    Args:
        file: The file.
        spec: The robot, for the search of a cycle.
        own: A catalogue whose sources are known besides the package's.

    Raises:
        ClipError: the file is missing or damaged, or its points cannot be told by their names.
    """
    path = file.path
    known = file.reader(own) if file.source or candidates(path, known_sources(own))[2] else None
    reader = known or guessed_source(path, file.rate)
    motion = reader.load(path, file.rate or None)
    found = find_cycles(pose_targets(motion, reader, spec), *cycle_frames(motion.rate), 1, LEAST_WAY)
    return Introduction(path, reader, motion, known is None, found[0] if found else None)


def guessed_source(path: Path, rate: float) -> PointSource:
    """Return a source for a file that none recognises, by the names of its points and by what is measured on them.

    Raises:
        ClipError: the file holds no points, or their names do not say which is which.
    """
    format_, names, _ = candidates(path, {})
    if format_ in ("frames", "pickle"):
        raise ClipError(f"{path}: rows of numbers that no source knows; describe them in a [source.NAME] of your own")
    columns, plain = "{point}_{axis}", names
    if format_ in ("table", "parquet"):
        columns, plain = column_pattern(names)
    points = guessed_points(plain)
    if missing := [point for point, name in points.items() if not name]:
        raise ClipError(
            f"{path}: no name tells which point is {', '.join(missing)}; describe the file in a [source.NAME] of your "
            f"own. It has: {', '.join(plain[:60])}"
        )
    kind = cast("PointFormat", "table" if format_ == "parquet" else format_)
    time = next((name for name in names if name.lower() in ("time", "t", "timestamp")), "")
    first = PointsDialect(kind, points, 1.0, 0.0, 0.0, 0.0, columns=columns, time=time, rate=rate)
    name = name_of(path).lower()
    return measured_source(path, f"my_{name}" if name in SOURCES else name, first)


def column_pattern(names: list[str]) -> tuple[str, list[str]]:
    """Return how the columns of a table are named, and the points that they are of."""
    for between in ("_", ".", " ", ""):
        points = [name.removesuffix(f"{between}x") for name in names if name.endswith(f"{between}x")]
        if len(points) >= len(KEYPOINTS) - 2:
            return f"{{point}}{between}{{axis}}", points
    return "{point}_{axis}", []


def measured_source(path: Path, name: str, dialect: PointsDialect) -> PointSource:
    """Return a dialect's source with unit, axes and proportions as they are measured on a file."""
    found = read_points(path, dialect)
    position = np.stack([found.points[dialect.points[point]] for point in KEYPOINTS], axis=1)
    position = position[np.isfinite(position).all(axis=(1, 2))]
    if len(position) == 0:
        raise ClipError(f"{path}: no frame has all ten points")
    hips, toes = position[:, 2:6], position[:, 6:10]
    down = np.median(hips - toes, axis=(0, 1))
    axis = int(np.argmax(np.abs(down)))
    up = ("" if down[axis] > 0.0 else "-") + "xyz"[axis]
    unit = min(UNITS, key=lambda one: abs(np.log(UNITS[one] * abs(down[axis]) / USUAL_HIP_HEIGHT)))
    upright = with_z_up(position, up, False)
    forward, left = upright[:, 1] - upright[:, 0], upright[:, 2] - upright[:, 3]
    left_handed = bool(np.median(forward[:, 0] * left[:, 1] - forward[:, 1] * left[:, 0]) < 0.0)
    trunk = UNITS[unit] * float(np.median(np.linalg.norm(forward, axis=1)))
    dialect = replace(dialect, unit=unit, up=up, left_handed=left_handed, scale=TRUNK_OF_GO2 / max(trunk, 1e-6))
    rough = source_of(name, dialect).load(path)
    measures = measured_proportions(rough)
    numbers = {one: round(getattr(measures, one), 3) for one in ("scale", "root_drop", "forward_lift", "foot_outward")}
    source = source_of(name, replace(dialect, **numbers))
    assert isinstance(source, PointSource)
    return source
