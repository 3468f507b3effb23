"""A hash of what a dataset says, to tell whether two runs gave the same."""

import hashlib
import json
from pathlib import Path

import numpy as np
import zarr

from kine2go_warp.dataset.location import described
from kine2go_warp.dataset.store import motion_names
from kine2go_warp.errors import DatasetError

INCIDENTAL = ("training_seconds", "software_version", "software_revision")
"""Attributes of a motion that say how it came about and nothing of its data."""


def motion_content(path: Path, motion: str) -> str:
    """Return a hash of all arrays of a motion, rejected rollouts included, and of its attributes but ``INCIDENTAL``.

    It does not depend on how the arrays are stored.

    Raises:
        DatasetError: the motion cannot be read.
    """
    digest = hashlib.sha256()
    try:
        group = zarr.open_group(path / motion, mode="r")
        attributes = {name: value for name, value in group.attrs.asdict().items() if name not in INCIDENTAL}
        digest.update(json.dumps(attributes, sort_keys=True).encode())
        for name, member in sorted(group.members(max_depth=None)):
            if isinstance(member, zarr.Array):
                values = np.ascontiguousarray(member[...])
                digest.update(f"{name} {values.dtype.str} {values.shape} ".encode())
                digest.update(values.tobytes())
    except Exception as error:  # noqa: BLE001 - codecs and stores raise errors of many kinds
        raise DatasetError(f"{path}/{motion}: cannot be read ({described(error)})") from None
    return digest.hexdigest()[:32]


def dataset_content(path: Path) -> str:
    """Return a hash of all motions of a dataset.

    Raises:
        DatasetError: there is no dataset, or it cannot be read.
    """
    contents = {motion: motion_content(path, motion) for motion in motion_names(path)}
    return hashlib.sha256(json.dumps(contents, sort_keys=True).encode()).hexdigest()[:32]
