"""What lies at a path: whether it is a dataset that this version reads, and which motions it holds."""

import contextlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from kine2go_warp.dataset.location import RemotePath, is_remote, root_attributes
from kine2go_warp.dataset.schema import FORMAT_VERSION
from kine2go_warp.errors import DatasetError
from kine2go_warp.names import check_name
from kine2go_warp.robots import DEFAULT_ROBOT, RobotSpec, stored_robot

NESTED = (
    "fidelity", "rejected", "borderline", "environment_settings", "model_parts", "gather_settings",
    "training_settings", "simulation", "observation_terms",
)  # fmt: skip
"""Attributes of a motion that are records or lists, each kept as a text of JSON: netCDF and many readers know numbers,
texts and lists of them alone."""


def packed(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Return attributes of a motion as they are stored."""
    return {name: json.dumps(value) if name in NESTED else value for name, value in attributes.items()}


def unpacked(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Return stored attributes of a motion as they were before ``packed``; a damaged text stays a text."""
    known = dict(attributes)
    for name in NESTED:
        if isinstance(known.get(name), str):
            with contextlib.suppress(ValueError):
                known[name] = json.loads(known[name])
    return known


def motion_names(path: Path) -> list[str]:
    """Return the names of the motions in a dataset.

    Raises:
        DatasetError: there is no dataset at ``path``, or it is of another format version.
    """
    if is_remote(path):
        return _listed(path)
    if (path.resolve().parent / "zarr.json").is_file():
        raise DatasetError(f"{path}: a part of a store; name the dataset itself, {path.resolve().parent}")
    if not (path / "zarr.json").is_file():
        raise DatasetError(f"{path}: {_absence(path)}; make a dataset with 'kine2go dataset gather' or 'kine2go run'")
    check_version(path)
    names = motion_folders(path)
    for name in names:
        check_name(name, path, DatasetError)
    return names


def motion_folders(path: Path) -> list[str]:
    """Return the names of the motions in a store, of whatever format it is; none if there is no store."""
    if not path.is_dir():
        return []
    with os.scandir(path) as entries:
        return sorted(entry.name for entry in entries if os.path.isfile(os.path.join(entry.path, "zarr.json")))  # noqa: PTH113, PTH118 - thousands of them


def _listed(path: Path) -> list[str]:
    """Return the names of the motions that the root of a dataset on a server lists: web servers list no folders.

    Raises:
        DatasetError: there is no dataset, or it lists no motions.
    """
    if not (path / "zarr.json").is_file():
        raise DatasetError(f"{path}: no dataset here, the server has no zarr.json in it")
    cast("RemotePath", path / "zarr.json").check_ranges()
    motions = check_version(path).get("motions")
    if not isinstance(motions, dict):
        raise DatasetError(
            f"{path}: does not list its motions, as datasets on a server must; open it once for writing where it is a "
            "folder ('kine2go dataset gather' does), and copy it again"
        )
    for name in motions:
        check_name(name, path, DatasetError)
    return sorted(motions)


def check_version(path: Path) -> dict[str, Any]:
    """Check that a store is one of ours, and return the attributes of its root.

    Raises:
        DatasetError: it is not, or its format version is another.
    """
    try:
        attributes = root_attributes(path)
    except (OSError, TypeError, ValueError) as error:
        raise DatasetError(f"{path}: not a Zarr store that can be read ({error.__class__.__name__})") from None
    if attributes.get("format") != "kine2go":
        raise DatasetError(f"{path}: a Zarr store, but not a dataset of kine2go")
    if attributes.get("format_version") != FORMAT_VERSION:
        raise DatasetError(
            f"{path}: dataset format {attributes.get('format_version')}; this version reads and writes "
            f"{FORMAT_VERSION}: gather the data again, or use the version that wrote it"
        )
    return attributes


def robot_in(attributes: Mapping[str, Any], path: Path) -> RobotSpec:
    """Return the robot that a dataset's root names.

    Raises:
        Kine2GoError: the robot is not available here.
    """
    return stored_robot(str(attributes.get("robot_reference", attributes.get("robot", DEFAULT_ROBOT))), str(path))


def _absence(path: Path) -> str:
    """Return why there is no dataset at a path."""
    if path.is_file():
        return "no dataset here, a dataset is a folder and this is a file"
    if not path.exists():
        return "no dataset here, nor anything else"
    return "no dataset here, the folder holds no zarr.json"
