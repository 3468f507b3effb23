"""Which source a file is for, by what is in it."""

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.keypoints import KEYPOINTS, KeypointMotion
from kine2go_warp.motions.sources.arrays import read_npz
from kine2go_warp.motions.sources.base import MotionSource
from kine2go_warp.motions.sources.bvh import read_bvh
from kine2go_warp.motions.sources.joints import READERS, JointSource
from kine2go_warp.motions.sources.points import C3D_MARK, PointSource, read_c3d, read_parquet
from kine2go_warp.motions.sources.tables import is_number, read_bytes, read_lines
from kine2go_warp.quantities import LEG_NAMES

PARQUET, PICKLE, ZIP = b"PAR1", b"\x80", b"PK\x03\x04"


def recognise(
    path: Path, sources: Mapping[str, MotionSource], rate: float | None = None
) -> tuple[MotionSource, KeypointMotion]:
    """Return the source that a file is for, and the motion in it.

    Args:
        path: The file.
        sources: To choose from, by name.
        rate: Frames per second of a file that cannot tell its own [Hz].

    Raises:
        ClipError: the file is missing or damaged, or none of them reads it.
    """
    format_, names, possible = candidates(path, sources)
    problem = None
    for source in possible:
        try:
            return source, source.load(path, rate)
        except ClipError as error:
            problem = problem or error
    if problem is not None:
        raise problem
    has = f" with {', '.join(names[:12])}{', ...' if len(names) > 12 else ''}" if names else ""
    raise ClipError(
        f"{path}: {KINDS[format_]}{has}, which no source reads; 'kine2go motion new {path}' writes one to edit"
    )


KINDS = {
    "bvh": "a BVH file",
    "c3d": "a C3D file",
    "frames": "a JSON file",
    "pickle": "a pickle",
    "torch": "a file of torch",
    "table": "a table",
    "parquet": "a Parquet file",
    "arrays": "an .npz",
}


def candidates(path: Path, sources: Mapping[str, MotionSource]) -> tuple[str, list[str], list[MotionSource]]:
    """Return a file's format, the names of its points or columns, and the sources that may be meant for it."""
    format_ = format_of(path)
    if format_ in ("frames", "pickle", "torch"):
        rows = READERS[format_](path)
        return format_, [], [one for one in _of(sources, format_) if one.takes(rows)]
    names = names_in(path, format_)
    found: list[MotionSource] = [
        one
        for one in sources.values()
        if isinstance(one, PointSource)
        and one.dialect.format == ("table" if format_ == "parquet" else format_)
        and one.takes(names)
    ]
    if format_ == "arrays" and ({"root_position", "joint_position"} <= set(names) or "body_pos_w" in names):
        found += _of(sources, "joint_arrays")
    if format_ == "table":
        lines = read_lines(path)
        if not all(is_number(word) for word in lines[0].rstrip(",").split(",")):
            found += [one for one in _of(sources, "joint_table") if one.names_columns(names)]
        found += [one for one in sources.values() if one.begins(lines[0])]
    return format_, names, found


def _of(sources: Mapping[str, MotionSource], format_: str) -> list[JointSource]:
    """Return the sources that read joints in some format."""
    return [one for one in sources.values() if isinstance(one, JointSource) and one.dialect.format == format_]


def format_of(path: Path) -> str:
    """Return a key of ``KINDS``, by how a file begins."""
    content = read_bytes(path)
    if content.startswith(ZIP):
        return "torch" if path.suffix.lower() == ".motion" else "arrays"
    if content.startswith(PICKLE):
        return "pickle"
    if content.startswith(PARQUET):
        return "parquet"
    if content[1:2] == bytes([C3D_MARK]) and path.suffix.lower() == ".c3d":
        return "c3d"
    if re.match(rb"(\xef\xbb\xbf)?\s*\{", content):
        return "frames"
    return "bvh" if re.match(rb"(\xef\xbb\xbf)?\s*HIERARCHY\b", content) else "table"


def names_in(path: Path, format_: str) -> list[str]:
    """Return the names of a file's points or columns."""
    if format_ == "bvh":
        return [joint.name for joint in read_bvh(path).joints]
    if format_ == "c3d":
        return list(read_c3d(path).points)
    if format_ == "parquet":
        return list(read_parquet(path))
    if format_ == "arrays":
        return list(read_npz(path))
    return [name.strip().strip('"') for name in read_lines(path)[0].split(",")]


HIPS = {
    "F": ("shoulder", "clav", "clavicle", "scapula", "upperarm", "humerus", "arm"),
    "R": ("upleg", "legupper", "upperleg", "thigh", "hip", "femur", "leg"),
}
TOES = {
    "F": ("handsite", "finger", "fronttoe", "forepaw", "frontpaw", "frontfoot", "hand", "wrist", "paw"),
    "R": ("footsite", "toe", "hindtoe", "hindpaw", "rearpaw", "hindfoot", "rearfoot", "foot", "ankle"),
}
TRUNK = {
    "pelvis": ("hips", "pelvis", "root", "sacrum", "tailbase"),
    "neck": ("neck", "neck1", "withers", "spine3", "chest"),
}
"""Words for the keypoints in other people's names, likelier ones first."""
SIDE = re.compile(r"(?i:left|right)|(?<![A-Za-z])[LRlr](?![a-z])|^[LR](?=[A-Z])|(?<=[a-z])[LR]$")


def guessed_points(names: Iterable[str]) -> dict[str, str]:
    """Return which of a file's points may be which keypoint; empty texts where no name says so.

    Our own names are taken as they are. Others are compared without sides and punctuation; of those that end in the
    same word the shortest is taken.
    """
    names = list(names)
    if set(KEYPOINTS) <= set(names):
        return {point: point for point in KEYPOINTS}
    plain = [(name, *_words(name)) for name in names]

    def find(side: str, words: tuple[str, ...]) -> str:
        for word in words:
            found = [(len(its), name) for name, its_side, its in plain if its_side == side and its.endswith(word)]
            if found:
                return min(found)[1]
        return ""

    points = {point: find("", words) for point, words in TRUNK.items()}
    for leg in LEG_NAMES:
        points[f"{leg}_hip"] = find(leg[1], HIPS[leg[0]])
        points[f"{leg}_toe"] = find(leg[1], TOES[leg[0]])
    return {point: points[point] for point in KEYPOINTS}


def _words(name: str) -> tuple[str, str]:
    """Return the side that a name tells (``L``, ``R`` or nothing) and the rest in small letters."""
    side = SIDE.search(name)
    rest = SIDE.sub("", name, count=1)
    return side[0][0].upper() if side else "", re.sub(r"[^A-Za-z0-9]", "", rest).lower()
