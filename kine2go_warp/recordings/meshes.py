"""Meshes of a robot's links that a user has, named as in the manufacturer's description."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr

from kine2go_warp.errors import RecordingError
from kine2go_warp.files import sha256_of
from kine2go_warp.recordings.shapes import Poses, about, xyzw
from kine2go_warp.recordings.stream import Columns
from kine2go_warp.rotations import multiply

SUFFIXES = {
    ".glb": "model/gltf-binary",
    ".obj": "model/obj",
    ".stl": "model/stl",
    ".dae": "model/vnd.collada+xml",
}
"""Kinds of files that the viewer reads and what it calls them; the first one found counts."""

NAMES = {"trunk": ("trunk", "base"), "hip": ("hip",), "thigh": ("thigh",), "calf": ("calf",)}
"""Links, and the names that their files may have."""

LEFT, RIGHT = [0, 2], [1, 3]
"""Legs by side, in the order FL, FR, RL, RR."""


@dataclass(frozen=True)
class Meshes:
    """A file for each kind of link. Those of the thighs and calves may have a mirrored one for the right side."""

    files: dict[str, Path]
    """By ``trunk``, ``hip``, ``thigh``, ``calf``, and ``thigh_mirror``, ``calf_mirror`` where there are any."""

    @classmethod
    def find(cls, folder: Path) -> "Meshes":
        """Look for the meshes in a folder.

        Raises:
            RecordingError: there is no such folder, or one of the files is missing.
        """
        if not folder.is_dir():
            raise RecordingError(f"{folder}: no such folder of meshes")
        files, missing = {}, []
        for link, names in NAMES.items():
            found = first_file(folder, names)
            if found is None:
                missing.append(link)
            else:
                files[link] = found
        if missing:
            raise RecordingError(
                f"{folder}: no mesh of {', '.join(missing)}; expected files named as in the Unitree description, such "
                f"as {missing[0]}.dae, of kind {', '.join(SUFFIXES)}"
            )
        for link in ("thigh_mirror", "calf_mirror"):
            if (found := first_file(folder, (link,))) is not None:
                files[link] = found
        return cls(files)

    def content(self) -> str:
        """Return a text that differs for other meshes."""
        return " ".join(f"{link}={sha256_of(file)}" for link, file in sorted(self.files.items()))

    def draw(self, columns: Columns, poses: Poses) -> None:
        """Draw the links of a robot. The trunk is fixed to the entity ``base``."""
        columns.fix("base/trunk", asset(self.files["trunk"]))
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


def asset(file: Path) -> rr.Asset3D:
    """Return a mesh for the viewer, which does not recognise every kind by itself."""
    return rr.Asset3D(path=file, media_type=SUFFIXES[file.suffix.lower()])


def first_file(folder: Path, names: tuple[str, ...]) -> Path | None:
    """Return the first file with one of the names and a suffix that is known."""
    wanted = [f"{name}{suffix}" for name in names for suffix in SUFFIXES]
    present = {path.name.lower(): path for path in folder.iterdir() if path.is_file()}
    return next((present[name] for name in wanted if name in present), None)
