"""Motions of named points: joints of a BVH skeleton, markers of a C3D file, columns of a table, arrays."""

import importlib.util
import io
import subprocess
import sys
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.errors import ClipError
from kine2go_warp.extras import named_extras
from kine2go_warp.motions.examination import UNITS
from kine2go_warp.motions.keypoints import KEYPOINTS, MINIMUM_FRAMES, KeypointMotion
from kine2go_warp.motions.sources.arrays import checked_rate, rate_of, read_npz
from kine2go_warp.motions.sources.base import MotionSource
from kine2go_warp.motions.sources.bvh import read_bvh
from kine2go_warp.motions.sources.dialects import PointsDialect
from kine2go_warp.motions.sources.joint_files import read_table
from kine2go_warp.motions.sources.tables import read_bytes
from kine2go_warp.tables import counted

Array = NDArray[np.float64]

LARGEST_COORDINATE = 1e6
C3D_MARK = 0x50
"""Second byte of a C3D file."""
C3D_TIME = 30.0
"""Longest time that reading one may take [s]."""
C3D_READER = """
import sys
import ezc3d, numpy
content = ezc3d.c3d(sys.argv[1])
header = content["parameters"]["POINT"]
labels = numpy.array([label.strip() for label in header["LABELS"]["value"]], dtype=str)
points = numpy.asarray(content["data"]["points"], numpy.float64)[:3, : len(labels)]
numpy.savez(sys.stdout.buffer, labels=labels, rate=float(header["RATE"]["value"][0]), points=points)
"""
AXES = {
    "x": ((1, 1.0), (2, 1.0), (0, 1.0)),
    "-x": ((1, 1.0), (2, -1.0), (0, -1.0)),
    "y": ((0, 1.0), (2, -1.0), (1, 1.0)),
    "-y": ((0, 1.0), (2, 1.0), (1, -1.0)),
    "z": ((0, 1.0), (1, 1.0), (2, 1.0)),
    "-z": ((0, 1.0), (1, -1.0), (2, -1.0)),
}
"""Where our x, y and z come from, by the file's axis that points up: the number of its axis, and the sign."""


@dataclass(frozen=True)
class NamedPoints:
    """Points of a file by name, in its axes and unit."""

    points: Mapping[str, Array]
    """Each of shape [num_frames, 3]; NaN where a point was not seen."""
    rate: float | None
    """Frames per second [Hz], where the file tells."""


@dataclass(frozen=True)
class PointSource(MotionSource):
    """Reads files of one dialect."""

    name: str
    dialect: PointsDialect
    scale: float
    root_drop: float
    forward_lift: float
    foot_outward: float
    unit: str

    def takes(self, names: Collection[str]) -> bool:
        """Return whether a file with points, or columns, of these names is likely one of this dialect."""
        wanted = {part.strip() for one in self.dialect.points.values() for part in one.split("+")}
        if self.dialect.format == "table":
            wanted = {self.dialect.columns.format(point=point, axis=axis) for point in wanted for axis in "xyz"}
        return wanted <= set(names)

    def read(self, path: Path) -> KeypointMotion:
        """Read a whole file; see ``MotionSource.read``."""
        dialect = self.dialect
        found = read_points(path, dialect)
        position = np.stack([one_point(found.points, dialect.points[name], path) for name in KEYPOINTS], axis=1)
        if len(position) < MINIMUM_FRAMES:
            raise ClipError(f"{path}: {counted(len(position), 'frame')}; a motion needs at least {MINIMUM_FRAMES}")
        rate = found.rate or dialect.rate
        if rate == 0.0:
            raise ClipError(f"{path}: tells no rate; state it in the table of the source, as in rate = 60")
        upright = with_z_up(UNITS[dialect.unit] * position, dialect.up, dialect.left_handed)
        return KeypointMotion(np.arange(len(position)) / rate, upright)


def read_points(path: Path, dialect: PointsDialect) -> NamedPoints:
    """Return all points of a file.

    Raises:
        ClipError: the file is missing, is something else, or is damaged.
    """
    if dialect.format == "bvh":
        bvh = read_bvh(path)
        return NamedPoints(bvh.positions(), bvh.rate)
    if dialect.format == "c3d":
        return read_c3d(path)
    return read_columns(path, dialect) if dialect.format == "table" else read_point_arrays(path, dialect.time)


def one_point(points: Mapping[str, Array], wanted: str, path: Path) -> Array:
    """Return a point, or the middle of two that are written as ``A + B``, shape [num_frames, 3]."""
    parts = []
    for name in (part.strip() for part in wanted.split("+")):
        if name not in points:
            near = ", ".join(sorted(points)[:40])
            raise ClipError(f"{path}: has no point '{name}'; it has: {near}")
        parts.append(points[name])
    return np.mean(parts, axis=0)


def with_z_up(points: Array, up: str, left_handed: bool) -> Array:
    """Return points in right-handed axes with z up.

    Args:
        points: Shape [..., 3].
        up: The file's axis that points up, such as ``y`` or ``-z``.
        left_handed: Whether the file's third axis points the other way.
    """
    points = points * [1.0, 1.0, -1.0] if left_handed else points
    return np.stack([sign * points[..., axis] for axis, sign in AXES[up]], axis=-1)


def read_c3d(path: Path) -> NamedPoints:
    """Read the markers of a C3D file.

    A process of its own reads it: damaged files can crash ezc3d or keep it busy for ever.

    Raises:
        ClipError: the file is missing, or is no C3D file that can be read.
    """
    check_c3d(read_bytes(path), path)
    with named_extras():
        if importlib.util.find_spec("ezc3d") is None:
            raise ModuleNotFoundError("No module named 'ezc3d'", name="ezc3d")
    command = [sys.executable, "-c", C3D_READER, str(path)]
    try:
        done = subprocess.run(command, capture_output=True, stdin=subprocess.DEVNULL, timeout=C3D_TIME, check=True)
        with np.load(io.BytesIO(done.stdout), allow_pickle=False) as data:
            labels, rate, points = [str(label) for label in data["labels"]], float(data["rate"]), data["points"]
    except (subprocess.SubprocessError, ValueError, OSError, EOFError, KeyError) as error:
        raise ClipError(f"{path}: a C3D file that is damaged or cut off ({error.__class__.__name__})") from None
    return NamedPoints({label: points[:, index].T for index, label in enumerate(labels)}, checked_rate(rate, path))


def check_c3d(content: bytes, path: Path) -> None:
    """Refuse a C3D file that ends before its data do.

    Raises:
        ClipError: it is no C3D file, or was cut off.
    """
    parameters = 512 * (content[0] - 1) if content else 0
    if not 512 <= parameters < len(content) - 4 or content[1] != C3D_MARK:
        raise ClipError(f"{path}: not a C3D file, or one that is damaged or cut off")
    # Numbers of PDP-11s and of big-endian processors have their bytes in other orders; a sign says what the data are.
    sign = {85: 13, 86: 12}.get(content[parameters + 3], 15)
    order = "big" if sign == 12 else "little"
    points, first, last, start = (int.from_bytes(content[place : place + 2], order) for place in (2, 6, 8, 16))
    size = 4 * (4 if content[sign] & 0x80 else 2)
    if last < first or 512 * (start - 1) + size * points * (last - first + 1) > len(content):
        raise ClipError(
            f"{path}: a C3D file that was cut off; it announces {points} points in {last - first + 1} frames"
        )


def read_columns(path: Path, dialect: PointsDialect) -> NamedPoints:
    """Read a CSV or Parquet file with three columns for each point.

    Raises:
        ClipError: the file is missing or damaged, or a column is not there.
    """
    columns = read_parquet(path) if path.suffix == ".parquet" else table_columns(path)
    points = {}
    for name in {part.strip() for names in dialect.points.values() for part in names.split("+")}:
        wanted = [dialect.columns.format(point=name, axis=axis) for axis in "xyz"]
        missing = [column for column in wanted if column not in columns]
        if missing:
            raise ClipError(f"{path}: has no column '{missing[0]}'; it has: {', '.join(list(columns)[:40])}")
        points[name] = np.stack([columns[column] for column in wanted], axis=-1)
    if dialect.time and dialect.time not in columns:
        raise ClipError(f"{path}: has no column '{dialect.time}' of time stamps")
    return NamedPoints(points, rate_of(columns[dialect.time], path) if dialect.time else None)


def table_columns(path: Path) -> dict[str, Array]:
    """Return the columns of a CSV file by name."""
    rows = read_table(path)
    return dict(zip(rows.columns, rows.values.T, strict=True))


def read_parquet(path: Path) -> dict[str, Array]:
    """Return the columns of numbers of a Parquet file by name.

    Raises:
        ClipError: the file is missing, or is no Parquet file.
    """
    content = read_bytes(path)
    with named_extras():
        import pyarrow
        import pyarrow.parquet
    try:
        table = pyarrow.parquet.read_table(io.BytesIO(content))
    except (pyarrow.ArrowException, OSError) as error:
        raise ClipError(f"{path}: not a Parquet file ({str(error).splitlines()[0][:80]})") from None
    numeric = [
        field.name
        for field in table.schema
        if pyarrow.types.is_floating(field.type) or pyarrow.types.is_integer(field.type)
    ]
    return {name: table[name].to_numpy().astype(np.float64) for name in numeric}


def read_point_arrays(path: Path, time: str) -> NamedPoints:
    """Read an ``.npz`` with an array of shape [num_frames, 3] for each point.

    Raises:
        ClipError: the file is missing, is something else, or an array has another shape.
    """
    arrays = {name: np.asarray(one, np.float64) for name, one in read_npz(path).items() if one.dtype.kind in "fiu"}
    points = {name: array for name, array in arrays.items() if array.ndim == 2 and array.shape[1] == 3}
    if len({len(array) for array in points.values()}) > 1:
        raise ClipError(f"{path}: its points have different numbers of frames")
    if time and time not in arrays:
        raise ClipError(f"{path}: has no array '{time}' of time stamps")
    return NamedPoints(points, rate_of(arrays[time], path) if time else None)
