"""Meshes of a robot's links that a user has, named as in the manufacturer's description."""

from collections.abc import Collection
from pathlib import Path

from kine2go_warp.errors import Kine2GoError

NAMES = {"trunk": ("trunk", "base"), "hip": ("hip",), "thigh": ("thigh",), "calf": ("calf",)}
"""Links, and the names that their files may have; the hip is that of the front left leg."""
MIRRORED = ("thigh_mirror", "calf_mirror")
"""Files for the right side, where there are any."""


def mesh_files(folder: Path, suffixes: Collection[str], error: type[Kine2GoError]) -> dict[str, Path]:
    """Look for meshes in a folder; the first suffix found counts.

    Args:
        folder: The folder.
        suffixes: Kinds of files that can be shown, such as ``.obj``.
        error: Type of error to raise.

    Returns:
        Files by ``trunk``, ``hip``, ``thigh``, ``calf``, and those of ``MIRRORED`` that are there.

    Raises:
        Kine2GoError: there is no such folder, or one of the files is missing.
    """
    if not folder.is_dir():
        raise error(f"{folder}: no such folder of meshes")
    present = {path.name.lower(): path for path in folder.iterdir() if path.is_file()}
    files, missing = {}, []
    for link, names in (*NAMES.items(), *((name, (name,)) for name in MIRRORED)):
        wanted = (f"{name}{suffix}" for name in names for suffix in suffixes)
        found = next((present[name] for name in wanted if name in present), None)
        if found is not None:
            files[link] = found
        elif link in NAMES:
            missing.append(link)
    if missing:
        raise error(
            f"{folder}: no mesh of {', '.join(missing)}; expected files named as in the Unitree description, such "
            f"as {missing[0]}{list(suffixes)[-1]}, of kind {', '.join(suffixes)}"
        )
    return files
