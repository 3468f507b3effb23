"""Meshes of a robot's links: our own, or those that a user has, named as in the manufacturer's description."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr

from kine2go_warp.errors import RecordingError
from kine2go_warp.files import sha256_of
from kine2go_warp.recordings.shapes import Poses, about, xyzw
from kine2go_warp.recordings.stream import Columns
from kine2go_warp.robots import RobotSpec
from kine2go_warp.robots.gltf import to_glb
from kine2go_warp.robots.look import look
from kine2go_warp.robots.mesh_files import mesh_files
from kine2go_warp.rotations import multiply

SUFFIXES = {
    ".glb": "model/gltf-binary",
    ".obj": "model/obj",
    ".stl": "model/stl",
    ".dae": "model/vnd.collada+xml",
}
"""Kinds of files that the viewer reads and what it calls them; the first one found counts."""

LEFT, RIGHT = [0, 2], [1, 3]
"""Legs by side, in the order FL, FR, RL, RR."""


@dataclass(frozen=True)
class Meshes:
    """A file for each kind of link. Those of the thighs and calves may have a mirrored one for the right side."""

    files: dict[str, Path | bytes]
    """By ``trunk``, ``hip``, ``thigh``, ``calf``, and ``thigh_mirror``, ``calf_mirror`` where there are any; bytes are
    those of a binary glTF. A robot without motors at its hips has no ``hip``."""

    @classmethod
    def of(cls, spec: RobotSpec) -> "Meshes":
        """Return our own meshes of a robot; its feet are drawn apart."""
        made = look(spec)
        del made["foot"]
        return cls({link: to_glb(surfaces) for link, surfaces in made.items() if surfaces})

    @classmethod
    def find(cls, folder: Path) -> "Meshes":
        """Look for the meshes in a folder.

        Raises:
            RecordingError: there is no such folder, or one of the files is missing.
        """
        return cls({**mesh_files(folder, SUFFIXES, RecordingError)})

    def content(self) -> str:
        """Return a text that differs for other meshes."""
        return " ".join(f"{link}={hash_of(file)}" for link, file in sorted(self.files.items()))

    def draw(self, columns: Columns, poses: Poses) -> None:
        """Draw the links of a robot. The trunk is fixed to the entity ``base``."""
        columns.fix("base/trunk", asset(self.files["trunk"]))
        if "hip" in self.files:
            columns.fix("hips", asset(self.files["hip"]))
            # The one mesh of a hip is that of the front left leg, turned by half a turn for the others.
            half = np.array([0.0, np.pi, 0.0, np.pi]), np.array([0.0, 0.0, np.pi, np.pi])
            hips = multiply(poses.hip, multiply(about(0, half[0]), about(1, half[1])))
            self._place(columns, "hips", poses.joint_centres(0), hips)
        for link, joint, turns in (("thigh", 1, poses.thigh), ("calf", 2, poses.calf)):
            for side, legs in (("left", LEFT), ("right", RIGHT)):
                mirrored = self.files.get(f"{link}_mirror", self.files[link])
                entity = f"{link}_{side}"
                columns.fix(entity, asset(self.files[link] if side == "left" else mirrored))
                self._place(columns, entity, poses.joint_centres(joint)[:, legs], turns[:, legs])

    def _place(self, columns: Columns, entity: str, centres: np.ndarray, turns: np.ndarray) -> None:
        """Move the instances of a mesh."""
        places = centres.reshape(-1, 3).astype(np.float32)
        quaternions = xyzw(turns).reshape(-1, 4).astype(np.float32)
        moved = rr.InstancePoses3D.columns(translations=places, quaternions=quaternions)
        columns.send(entity, moved, centres.shape[1])


def asset(file: Path | bytes) -> rr.Asset3D:
    """Return a mesh for the viewer, which does not recognise every kind by itself."""
    if isinstance(file, bytes):
        return rr.Asset3D(contents=file, media_type=SUFFIXES[".glb"])
    return rr.Asset3D(path=file, media_type=SUFFIXES[file.suffix.lower()])


def hash_of(file: Path | bytes) -> str:
    """Return the SHA-256 of a file."""
    return hashlib.sha256(file).hexdigest() if isinstance(file, bytes) else sha256_of(file)
