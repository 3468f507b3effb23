"""How the robots look: low-polygon surfaces of our own, which follow a robot's lengths, radii and colours."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.robots.spec import RobotSpec
from kine2go_warp.robots.urdf import UrdfReader, read_origin

Array = NDArray[np.float64]
Colour = tuple[float, float, float]

SIDES = 16
"""Corners of a cross-section."""
COLOURS = {
    "shell": (0.62, 0.64, 0.68),
    "dark": (0.16, 0.17, 0.20),
    "rubber": (0.05, 0.05, 0.05),
    "accent": (0.10, 0.45, 0.75),
}
"""Of robots whose URDF has no material of that name."""
LIDARS = {"go2": ((0.289, 0.0, -0.047), 0.038, 0.05), "b2": ((0.342, 0.0, 0.105), 0.076, 0.06)}
"""Centre in the base frame, radius and height of the lidars that some carry [m], by the makers' URDFs."""


@dataclass(frozen=True)
class Surface:
    """A closed surface of triangles in the frame of a link."""

    vertices: Array
    """[m], shape [num_vertices, 3]."""
    faces: NDArray[np.int64]
    """Vertices of each triangle, counter-clockwise seen from outside, shape [num_faces, 3]."""
    colour: Colour
    """Red, green, blue, from 0 to 1."""

    def moved(self, axis: int, by: float) -> "Surface":
        """Return the surface moved along a coordinate axis [m]."""
        return replace(self, vertices=self.vertices + by * np.eye(3)[axis])

    def turned(self, signs: tuple[float, float, float]) -> "Surface":
        """Return the surface with some coordinates negated: turned by half a turn, or mirrored."""
        faces = self.faces if np.prod(signs) > 0.0 else self.faces[:, ::-1]
        return replace(self, vertices=self.vertices * signs, faces=faces)


@dataclass(frozen=True)
class Motors:
    """The cylinders at the hips that hold the motors of the thighs, from the visual shapes of the URDF."""

    radius: float
    """[m]"""
    length: float
    """[m]"""
    centres: Array
    """Centre of each leg's cylinder in the frame of its hip [m], shape [4, 3]."""

    @classmethod
    def of(cls, spec: RobotSpec) -> "Motors | None":
        """Read the shapes of a robot, none where the hips have other ones."""
        reader = UrdfReader(spec.urdf)
        found = [reader.root.find(f"link[@name='{hip}']/visual/geometry/cylinder/../..") for hip in spec.leg_links[::3]]
        centres = [read_origin(visual)[0] for visual in found if visual is not None]
        if len(centres) < len(found):
            return None
        cylinder = reader.find(f"link[@name='{spec.leg_links[0]}']/visual/geometry/cylinder").attrib
        return cls(float(cylinder["radius"]), float(cylinder["length"]), np.array(centres))


def loft(axis: int, stations: Sequence[tuple[float, ...]], colour: Colour, exponent: float = 2.0) -> Surface:
    """Return the closed surface through cross-sections along a coordinate axis.

    Args:
        axis: 0, 1 or 2.
        stations: Of each cross-section its place along the axis, its half widths along the two following axes, and its
            middle there, which may be left out [m]. Places increase.
        colour: Of the surface.
        exponent: 2 for ellipses; the greater, the nearer to rectangles.
    """
    angle = 2.0 * np.pi * np.arange(SIDES) / SIDES
    round_ = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    outline = np.sign(round_) * np.abs(round_) ** (2.0 / exponent)
    table = np.array([[*station, 0.0, 0.0][:5] for station in stations])
    rings = np.empty((len(table), SIDES, 3))
    rings[..., axis] = table[:, :1]
    rings[..., [(axis + 1) % 3, (axis + 2) % 3]] = table[:, None, 1:3] * outline + table[:, None, 3:5]
    corner, following = np.arange(SIDES), (np.arange(SIDES) + 1) % SIDES
    faces = []
    for low in range(0, SIDES * (len(table) - 1), SIDES):
        high = low + SIDES
        faces.append(np.stack([low + corner, low + following, high + following], axis=-1))
        faces.append(np.stack([low + corner, high + following, high + corner], axis=-1))
    # The ends have corners of their own, so that edges stay sharp.
    first, last = SIDES * len(table), SIDES * (len(table) + 1)
    middles = np.full(SIDES, last + SIDES), np.full(SIDES, last + SIDES + 1)
    faces.append(np.stack([middles[0], first + following, first + corner], axis=-1))
    faces.append(np.stack([middles[1], last + corner, last + following], axis=-1))
    ends = [rings[0], rings[-1], rings[[0, -1]].mean(axis=1)]
    return Surface(np.concatenate([rings.reshape(-1, 3), *ends]), np.concatenate(faces), colour)


def disc(axis: int, place: tuple[float, float], radius: float, colour: Colour) -> Surface:
    """Return a disc with bevelled rims, from one place to another along an axis [m]."""
    begin, end = place
    bevel = 0.2 * min(end - begin, radius)
    inner = radius - bevel
    stations = [
        (begin, inner, inner),
        (begin + bevel, radius, radius),
        (end - bevel, radius, radius),
        (end, inner, inner),
    ]
    return loft(axis, stations, colour)


def colours_of(spec: RobotSpec) -> dict[str, Colour]:
    """Return the colours of a robot's parts by the names of the materials in its URDF."""
    root = UrdfReader(spec.urdf).root
    found = dict(COLOURS)
    for name in COLOURS:
        if (element := root.find(f"material[@name='{name}']/color")) is not None:
            red, green, blue, _ = (float(value) for value in element.attrib["rgba"].split())
            found[name] = (red, green, blue)
    return found


def trunk(spec: RobotSpec, colours: dict[str, Colour], motor: float) -> list[Surface]:
    """Return trunk, back, head, face and lidar in the base frame; ``motor`` is the radius at the hips [m]."""
    x, y, _ = (abs(value) for value in spec.legs[0].hip_offset)
    wide, high = y + 0.85 * motor, 0.5 * spec.trunk_size[2]
    body = [
        *((-1.16 * x, 0.55 * y, 0.5 * high), (-1.1 * x, 0.85 * y, 0.8 * high), (-0.86 * x, 0.95 * y, 0.95 * high)),
        *((-0.68 * x, wide, high), (0.0, 1.02 * wide, 1.05 * high), (0.68 * x, wide, high)),
        *((0.86 * x, 0.95 * y, 0.95 * high), (1.12 * x, 0.9 * y, 0.85 * high)),
    ]
    back = [(-0.6 * x, 0.5 * wide, 0.12 * high), (-0.5 * x, 0.6 * wide, 0.2 * high)]
    back += [(0.4 * x, 0.6 * wide, 0.2 * high), (0.6 * x, 0.3 * wide, 0.12 * high)]
    (middle, _, low), radius = spec.head_centre, spec.head_radius
    face = max(y, 0.85 * radius)
    head = [(1.06 * x, 0.85 * y, 0.75 * high, 0.0, 0.0), (middle - 0.3 * radius, face, 0.85 * radius, 0.0, low)]
    head += [(middle + 0.5 * radius, 0.95 * face, 0.8 * radius, 0.0, low)]
    head += [(middle + radius, 0.75 * face, 0.5 * radius, 0.0, low)]
    end = middle + radius
    plate = [
        (end - 0.1 * radius, 0.7 * face, 0.42 * radius, 0.0, low),
        (end + 0.05 * radius, 0.6 * face, 0.36 * radius, 0.0, low),
    ]
    raised = [(place, half_y, half_z, 0.0, 1.03 * high) for place, half_y, half_z in back]
    made = [loft(0, body, colours["shell"], 5.0), loft(0, raised, colours["dark"], 5.0)]
    made += [loft(0, head, colours["shell"], 4.0), loft(0, plate, colours["accent"], 4.0)]
    if spec.name in LIDARS:
        (forward, _, up), wide, tall = LIDARS[spec.name]
        bulb = disc(2, (up - 0.5 * tall, up + 0.5 * tall), wide, colours["dark"])
        made.append(bulb.moved(0, forward))
    return made


def hip(motors: Motors | None, colours: dict[str, Colour]) -> list[Surface]:
    """Return the front left hip in its frame: the housing on the roll axis and the motor of the thigh."""
    if motors is None:
        return []
    radius, centre, half = motors.radius, motors.centres[0, 1], 0.5 * motors.length
    housing = disc(0, (-0.95 * radius, 0.95 * radius), 0.8 * radius, colours["dark"])
    motor = disc(1, (centre - half, centre + half), radius, colours["dark"])
    neck = loft(1, [(0.0, 0.55 * radius, 0.55 * radius), (centre, 0.55 * radius, 0.55 * radius)], colours["shell"], 3.0)
    return [housing, motor, neck]


def thigh(spec: RobotSpec, colours: dict[str, Colour], motor: float) -> list[Surface]:
    """Return a left thigh in its frame, its cover outwards."""
    length, radius = spec.legs[0].thigh_length, spec.thigh_radius
    bar = [
        (-length, 1.0 * radius, 0.8 * radius, 0.0),
        (-0.8 * length, 1.05 * radius, 0.8 * radius, -0.4 * radius),
        (-0.45 * length, 1.45 * radius, 0.9 * radius, -0.5 * radius),
        (-0.15 * length, 0.75 * motor, 1.0 * radius, -0.2 * radius),
        (0.3 * motor, 0.75 * motor, 1.0 * radius, 0.0),
        (0.7 * motor, 0.4 * motor, 0.8 * radius, 0.0),
    ]
    cover = disc(1, (-0.6 * radius, 1.5 * radius), 0.95 * motor, colours["shell"])
    cap = disc(1, (1.2 * radius, 1.7 * radius), 0.6 * motor, colours["dark"])
    knee = disc(1, (-0.95 * radius, 0.95 * radius), 1.25 * radius, colours["dark"])
    knee = knee.moved(2, -length)
    return [loft(2, bar, colours["shell"], 3.0), cover, cap, knee]


def calf(spec: RobotSpec, colours: dict[str, Colour]) -> list[Surface]:
    """Return a calf in its frame, without its foot."""
    length, radius = spec.legs[0].calf_length, spec.calf_radius
    bar = [
        (-length + 0.5 * spec.foot_radius, 0.85 * radius, 0.85 * radius, 0.0),
        (-0.75 * length, 0.9 * radius, 0.85 * radius, 0.6 * radius),
        (-0.4 * length, 1.3 * radius, 1.0 * radius, 1.0 * radius),
        (-0.1 * length, 1.6 * radius, 1.1 * radius, 0.3 * radius),
        (0.9 * radius, 1.1 * radius, 1.0 * radius, 0.0),
    ]
    return [loft(2, bar, colours["dark"])]


def foot(spec: RobotSpec, colours: dict[str, Colour]) -> list[Surface]:
    """Return the ball of a foot about its centre."""
    angle = np.linspace(-0.45 * np.pi, 0.45 * np.pi, 9)
    radius = spec.foot_radius
    stations = [(radius * np.sin(one), radius * np.cos(one), radius * np.cos(one)) for one in angle]
    return [loft(2, stations, colours["rubber"])]


def look(spec: RobotSpec) -> dict[str, list[Surface]]:
    """Return the surfaces of a robot, each in the frame of its link.

    Returns:
        Those of ``trunk``, of ``hip``, which is the front left one, of ``thigh`` and ``calf`` of a left leg, of
        ``thigh_mirror`` of a right one, and of ``foot``.
    """
    colours, motors = colours_of(spec), Motors.of(spec)
    motor = 2.0 * spec.thigh_radius if motors is None else motors.radius
    upper = thigh(spec, colours, motor)
    return {
        "trunk": trunk(spec, colours, motor),
        "hip": hip(motors, colours),
        "thigh": upper,
        "thigh_mirror": [surface.turned((1.0, -1.0, 1.0)) for surface in upper],
        "calf": calf(spec, colours),
        "foot": foot(spec, colours),
    }


def link_surfaces(spec: RobotSpec) -> dict[str, list[Surface]]:
    """Return the surfaces of every link of a robot that has any, by the link's name."""
    made = look(spec)
    found = {spec.base_link: made["trunk"]}
    for leg, links, foot_link in zip(spec.legs, np.reshape(spec.leg_links, (4, 3)), spec.foot_links, strict=True):
        along, side = 1.0 if leg.name[0] == "F" else -1.0, 1.0 if leg.name[1] == "L" else -1.0
        # Half turns of the front left hip, as of the makers' meshes.
        found[str(links[0])] = [one.turned((along, side, along * side)) for one in made["hip"]]
        found[str(links[1])] = made["thigh" if side > 0.0 else "thigh_mirror"]
        found[str(links[2])] = made["calf"]
        found[foot_link] = made["foot"]
    return found
