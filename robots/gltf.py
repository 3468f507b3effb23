"""Surfaces as binary glTF 2.0: the subset of the format that they need.

``python -m kine2go_warp.robots.gltf ROBOT FOLDER`` writes how a robot looks, a file for each kind of link.
"""

import json
import struct
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.robots.look import Surface, look
from kine2go_warp.robots.registry import robot_named

MAGIC, VERSION, JSON_CHUNK, BINARY_CHUNK = 0x46546C67, 2, 0x4E4F534A, 0x004E4942
FLOAT, UNSIGNED = 5126, 5125
"""glTF's numbers of component types."""


def to_glb(surfaces: Sequence[Surface]) -> bytes:
    """Return a file with one mesh, a primitive with a material of its own for each surface."""
    buffer, views, accessors, primitives, materials = b"", [], [], [], []

    def add(values: NDArray[Any], component: int, kind: str, **bounds: Any) -> int:
        nonlocal buffer
        views.append({"buffer": 0, "byteOffset": len(buffer), "byteLength": values.nbytes})
        count = {"bufferView": len(views) - 1, "componentType": component, "count": len(values), "type": kind}
        accessors.append({**count, **bounds})
        buffer += values.tobytes()
        return len(accessors) - 1

    for surface in surfaces:
        points = surface.vertices.astype("<f4")
        bounds = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
        attributes = {
            "POSITION": add(points, FLOAT, "VEC3", **bounds),
            "NORMAL": add(normals(surface).astype("<f4"), FLOAT, "VEC3"),
        }
        indices = add(surface.faces.astype("<u4").ravel(), UNSIGNED, "SCALAR")
        colour = {"baseColorFactor": [*surface.colour, 1.0], "metallicFactor": 0.1, "roughnessFactor": 0.6}
        materials.append({"pbrMetallicRoughness": colour})
        primitives.append({"attributes": attributes, "indices": indices, "material": len(materials) - 1})
    content = {
        "asset": {"version": "2.0", "generator": "kine2go_warp"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": primitives}],
        "materials": materials,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(buffer)}],
    }
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), JSON_CHUNK) + text + struct.pack("<II", len(buffer), BINARY_CHUNK) + buffer
    return struct.pack("<III", MAGIC, VERSION, 12 + len(chunks)) + chunks


def normals(surface: Surface) -> NDArray[np.float64]:
    """Return the unit normals at the vertices, means of their triangles' weighted by area, shape [num_vertices, 3]."""
    a, b, c = np.moveaxis(surface.vertices[surface.faces], 1, 0)
    found = np.zeros_like(surface.vertices)
    for corner in range(3):
        np.add.at(found, surface.faces[:, corner], np.cross(b - a, c - a))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


if __name__ == "__main__":
    robot, folder = sys.argv[1:]
    Path(folder).mkdir(parents=True, exist_ok=True)
    for kind, surfaces in look(robot_named(robot)).items():
        (Path(folder) / f"{kind}.glb").write_bytes(to_glb(surfaces))
