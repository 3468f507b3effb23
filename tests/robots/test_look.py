"""How the robots look: closed surfaces of few triangles that follow the robot's own lengths."""

import json
import struct
from collections import Counter

import numpy as np
import pytest

from kine2go_warp.robots import GO2, ROBOTS, robot_named
from kine2go_warp.robots.gltf import normals, to_glb
from kine2go_warp.robots.look import Motors, link_surfaces, look

every_robot = pytest.mark.parametrize("spec", [robot_named(name) for name in ROBOTS], ids=list(ROBOTS))


def extent(surfaces):
    points = np.concatenate([surface.vertices for surface in surfaces])
    return points.min(axis=0), points.max(axis=0)


@every_robot
def test_surfaces_are_closed_face_outwards_and_have_few_triangles(spec):
    made = look(spec)
    assert sum(len(surface.faces) for surfaces in made.values() for surface in surfaces) < 3500
    for surface in (one for surfaces in made.values() for one in surfaces):
        # Rims have corners twice, for sharp edges: places count.
        corners = [tuple(place) for place in np.round(surface.vertices, 9)]
        edges = Counter()
        for face in surface.faces:
            for begin, end in zip(face, np.roll(face, -1), strict=True):
                edges[corners[begin], corners[end]] += 1
        assert all(count == edges[end, begin] == 1 for (begin, end), count in edges.items())
        a, b, c = np.moveaxis(surface.vertices[surface.faces], 1, 0)
        assert np.sum(a * np.cross(b, c)) > 0.0, "the enclosed volume is positive where faces look outwards"


@every_robot
def test_links_reach_from_joint_to_joint(spec):
    made = look(spec)
    leg = spec.legs[0]
    for kind, length in (("thigh", leg.thigh_length), ("calf", leg.calf_length)):
        low, high = extent(made[kind])
        assert -1.15 * length < low[2] < -0.95 * length + spec.foot_radius
        assert 0.0 < high[2] < 0.3 * length
    low, high = extent(made["foot"])
    np.testing.assert_allclose([high[0], -low[0]], spec.foot_radius, rtol=0.01)
    low, high = extent(made["trunk"])
    assert high[0] == pytest.approx(spec.head_centre[0] + spec.head_radius, abs=0.1 * spec.head_radius)
    assert low[0] < spec.legs[2].hip_offset[0]


@every_robot
def test_right_legs_mirror_left_ones(spec):
    found = link_surfaces(spec)
    for left, right in zip(
        np.reshape(spec.leg_links, (4, 3))[::2], np.reshape(spec.leg_links, (4, 3))[1::2], strict=True
    ):
        for one, other in zip(left, right, strict=True):
            (low, high), (there, beyond) = extent(found[str(one)]), extent(found[str(other)])
            np.testing.assert_allclose(there, [low[0], -high[1], low[2]], atol=1e-12)
            np.testing.assert_allclose(beyond, [high[0], -low[1], high[2]], atol=1e-12)


def test_motors_are_those_of_the_urdf():
    motors = Motors.of(GO2)
    assert (motors.radius, motors.length) == (0.046, 0.04)
    np.testing.assert_allclose(motors.centres[:, 1], [0.08, -0.08, 0.08, -0.08])


def test_a_gltf_holds_the_same_triangles_with_normals_and_colours():
    """The file is read by the format's own rules."""
    surfaces = look(GO2)["thigh"]
    content = to_glb(surfaces)
    magic, version, size, text_size, kind = struct.unpack_from("<4sIII4s", content)
    assert (magic, version, size, kind) == (b"glTF", 2, len(content), b"JSON")
    values = json.loads(content[20 : 20 + text_size])
    binary_size, kind = struct.unpack_from("<I4s", content, 20 + text_size)
    binary = content[28 + text_size :]
    assert (binary_size, kind) == (len(binary), b"BIN\0")

    def read(index, dtype):
        accessor = values["accessors"][index]
        view = values["bufferViews"][accessor["bufferView"]]
        part = np.frombuffer(binary[view["byteOffset"] :][: view["byteLength"]], dtype)
        assert len(part) == accessor["count"] * {"SCALAR": 1, "VEC3": 3}[accessor["type"]]
        return part.reshape(accessor["count"], -1)

    primitives = values["meshes"][0]["primitives"]
    assert len(primitives) == len(surfaces)
    for primitive, surface in zip(primitives, surfaces, strict=True):
        points = read(primitive["attributes"]["POSITION"], "<f4")
        np.testing.assert_allclose(points, surface.vertices, atol=1e-7)
        np.testing.assert_array_equal(read(primitive["indices"], "<u4").reshape(-1, 3), surface.faces)
        stored = read(primitive["attributes"]["NORMAL"], "<f4")
        np.testing.assert_allclose(stored, normals(surface), atol=1e-6)
        np.testing.assert_allclose(np.linalg.norm(stored, axis=1), 1.0, atol=1e-5)
        material = values["materials"][primitive["material"]]["pbrMetallicRoughness"]
        assert material["baseColorFactor"][:3] == pytest.approx(surface.colour)
