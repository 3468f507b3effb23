"""Descriptions of file formats: a table in TOML for each, rather than a class.

``dialects.toml`` has those that come with the package; a catalogue of one's own may have more, as ``[source.NAME]``.
"""

import json
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Any, Literal, get_args

from kine2go_warp.errors import CatalogueError
from kine2go_warp.motions.keypoints import KEYPOINTS
from kine2go_warp.quantities import LEG_NAMES
from kine2go_warp.robots import robot_named
from kine2go_warp.robots.kinematics import HasLegs
from kine2go_warp.robots.registry import ROBOTS
from kine2go_warp.robots.spec import Leg
from kine2go_warp.settings import check_ranges, from_dictionary
from kine2go_warp.toml import place_in, read_toml

DIALECTS_FILE = Path(__file__).with_name("dialects.toml")

PointFormat = Literal["bvh", "c3d", "table", "arrays"]
JointFormat = Literal["frames", "pickle", "joint_table", "joint_arrays", "torch"]
Unit = Literal["metres", "centimetres", "millimetres", "inches", "feet"]


@dataclass(frozen=True)
class PointsDialect:
    """A file of named points of an animal."""

    format: PointFormat
    """``table``: CSV or Parquet; ``arrays``: ``.npz`` with an array of shape [num_frames, 3] for each point."""
    points: dict[str, str] = field(hash=False)
    """Name in the file of each keypoint; ``A + B`` is the middle of two."""
    scale: float
    """Size of the Go2 over the size of the animal; this and the next three are those of ``MotionSource``."""
    root_drop: float
    """[m]"""
    forward_lift: float
    """[m]"""
    foot_outward: float
    """[m]"""
    unit: Unit = "metres"
    """Of the file's lengths."""
    up: Literal["x", "y", "z", "-x", "-y", "-z"] = "y"
    """Which of the file's axes points up."""
    left_handed: bool = False
    """Whether the file's third axis points the other way."""
    columns: str = "{point}_{axis}"
    """How the columns of a table are named; the axes are x, y, z."""
    time: str = ""
    """Column or array of time stamps [s], if there is one."""
    rate: float = 0.0
    """Frames per second of files that do not tell [Hz]."""
    description: str = ""

    def __post_init__(self) -> None:
        if set(self.points) != set(KEYPOINTS):
            raise ValueError(f"points must name {', '.join(KEYPOINTS)}, each of them once")
        check_ranges(self, scale=(1e-3, 1e3), root_drop=(-1, 1), forward_lift=(-1, 1), foot_outward=(-1, 1))
        check_ranges(self, rate=(0, 1000))


@dataclass(frozen=True)
class JointsDialect:
    """A file of the base and the joints of a robot with three joints a leg, such as the Go2."""

    format: JointFormat
    """``frames``: JSON; ``joint_table``: CSV with a line of names; ``joint_arrays``: ``.npz`` like our own, or mjlab's;
    ``torch``: ``.motion`` of ProtoMotions."""
    robots: tuple[str, ...]
    """Whose joints they may be. Where there are columns of toes, the robot that fits them is taken, else the first."""
    position: tuple[str, ...]
    """Columns of the base's position [m]: names, or ranges of numbers such as ``0:3``."""
    orientation: tuple[str, ...]
    """Columns of its orientation."""
    joints: tuple[str, ...]
    """Columns of the twelve joints [rad], leg by leg."""
    toes: tuple[str, ...] = ()
    """Columns of the four feet in the frame of the base [m], leg by leg as the joints."""
    legs: tuple[str, ...] = ()
    """Order of the legs. Where it is left out, the order that fits the columns of toes is taken."""
    tells_legs: bool = False
    """Whether the file itself tells the order of its legs."""
    form: Literal["xyzw", "wxyz", "rotation_vector"] = "xyzw"
    """How the orientation is written."""
    turned: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    """Orientation (x, y, z, w) of a robot that stands upright and looks along the x axis."""
    sign: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Direction of hip, thigh and calf against Unitree's."""
    mirrored_hips: bool = False
    """Whether hips of the right legs turn the other way than those of the left."""
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """What is added to hip, thigh and calf after ``sign`` [rad]."""
    root_drop: float = 0.0
    """How far the base is lowered where the file's robot stands on nearly straight legs, in the Go2's size [m]."""
    width: int = 0
    """Number of columns; 0 for any."""
    rate: float = 0.0
    """Frames per second of files that do not tell [Hz]."""
    description: str = ""

    def __post_init__(self) -> None:
        if self.legs and sorted(self.legs) != sorted(LEG_NAMES):
            raise ValueError(f"legs must be {', '.join(LEG_NAMES)} in some order")
        if not self.legs and not self.toes and not self.tells_legs and self.format != "joint_arrays":
            raise ValueError("legs must be stated where there are no columns of toes")
        if not self.robots:
            raise ValueError("robots must name at least one")
        for name in self.robots:
            robot_of_files(name)
        check_ranges(self, rate=(0, 1000), root_drop=(-1, 1))


Dialect = PointsDialect | JointsDialect


@dataclass(frozen=True)
class Legs:
    """Legs of a robot that is not among ours, whose joints some files have."""

    hip: tuple[float, float, float]
    """Left front hip joint from the base's origin [m]."""
    rear: float
    """How far the rear hips lie before the origin [m]."""
    beside: float
    """Thigh joint from the hip joint, outwards [m]."""
    thigh: float
    """Length of the thigh [m]."""
    calf: float
    """Length of the calf, to the centre of the foot [m]."""

    @property
    def legs(self) -> tuple[Leg, ...]:
        """FL, FR, RL, RR."""
        legs = []
        for name in LEG_NAMES:
            side = 1.0 if name[1] == "L" else -1.0
            hip = (self.hip[0] if name[0] == "F" else self.rear, side * self.hip[1], self.hip[2])
            legs.append(Leg(name, hip, (0.0, side * self.beside, 0.0), self.thigh, self.calf))
        return tuple(legs)


@cache
def bundled_dialects() -> dict[str, Dialect]:
    """Return the package's dialects by name."""
    return parse_dialects(*read_toml(DIALECTS_FILE, CatalogueError), DIALECTS_FILE.name)


@cache
def robot_of_files(robot: str) -> HasLegs:
    """Return the legs of a robot, whether it is one of ours or only known from files.

    Raises:
        CatalogueError: it is neither.
    """
    known = read_toml(DIALECTS_FILE, CatalogueError)[0]["robot"]
    if robot in known:
        return from_dictionary(Legs, known[robot], f"{DIALECTS_FILE.name}, [robot.{robot}]", CatalogueError)
    if robot in ROBOTS or ":" in robot:
        return robot_named(robot)
    raise CatalogueError(f"unknown robot '{robot}'; known are: {', '.join(sorted({*known, *ROBOTS}))}, or FILE.py:NAME")


def parse_dialects(values: dict[str, Any], text: str, where: str) -> dict[str, Dialect]:
    """Return the dialects of a TOML file by name.

    Args:
        values: What the file holds.
        text: Its text, to name lines.
        where: Name of the file.

    Raises:
        CatalogueError: a field is missing, unknown or of another type.
    """
    locate = partial(place_in, text)
    tables = values.get("source", {})
    if not isinstance(tables, dict) or not all(isinstance(one, dict) for one in tables.values()):
        raise CatalogueError(f"{where}: 'source' must be a section for each source, such as [source.my_dogs]")
    found: dict[str, Dialect] = {}
    for name, one in tables.items():
        format_ = one.get("format", "")
        if format_ not in (known := (*get_args(PointFormat), *get_args(JointFormat))):
            place = locate(f"source.{name}.format")
            raise CatalogueError(f"{where}{place}: format is {json.dumps(format_)}; allowed are: {', '.join(known)}")
        kind = PointsDialect if format_ in get_args(PointFormat) else JointsDialect
        found[name] = from_dictionary(
            kind,
            one,
            where,
            CatalogueError,
            lambda key, name=name: locate(f"source.{name}.{key}" if key else f"source.{name}"),
        )
    return found
