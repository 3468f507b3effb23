"""What the root of a store lists: its motions with their counts, and the arrays of a few of them."""

import json
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import zarr
from zarr.buffer.cpu import Buffer
from zarr.storage import MemoryStore

from kine2go_warp.dataset.staging import StagingArea

INDEXED_MOTIONS = 64
"""Up to so many motions the root lists the arrays of all, 0.2 MB each, for readers of the whole tree."""


def write_index(area: StagingArea, motions: Sequence[str], counts: Mapping[str, dict[str, int]]) -> None:
    """Write the lists of motions and arrays into the metadata of a store's root.

    Of many motions the arrays are not listed, which would make the file slow to read: each motion lists its own.

    Args:
        area: Of the store.
        motions: Names of its motions.
        counts: What is known of them already.
    """
    metadata = area.root_metadata()
    metadata["attributes"]["motions"] = {name: counts.get(name) or counted(area.store / name) for name in motions}
    metadata.pop("consolidated_metadata", None)
    if len(motions) <= INDEXED_MOTIONS:
        store = area.store
        texts = {path.relative_to(store).as_posix(): path.read_bytes() for path in store.rglob("zarr.json")}
        # In memory, since zarr's own way of writing a file would leave a part of it inside the store after a kill.
        buffers = {name: Buffer.from_bytes(text) for name, text in texts.items()}
        buffers["zarr.json"] = Buffer.from_bytes(json.dumps(metadata).encode())
        consolidate(MemoryStore(buffers))  # pyright: ignore[reportArgumentType] - invariant in zarr
        metadata = json.loads(buffers["zarr.json"].to_bytes())
    area.replace_root_metadata(metadata)


def counted(motion: Path) -> dict[str, int]:
    """Return how many trajectories and rows a motion has, nothing where that cannot be read."""
    try:
        lengths = np.asarray(zarr.open_group(motion, mode="r")["length"][...])  # pyright: ignore[reportArgumentType, reportIndexIssue]
    except Exception:  # noqa: BLE001 - damaged data raise errors of many kinds
        return {}
    return {"trajectories": len(lengths), "rows": int(lengths.sum())}


def consolidate(group: Path | MemoryStore) -> None:
    """Put the metadata of all arrays below a group into its own, so that readers need one file and do not warn."""
    with warnings.catch_warnings():
        # Not in the Zarr 3 core specification yet; readers that do not know it read the arrays' own metadata.
        warnings.simplefilter("ignore")
        zarr.consolidate_metadata(group, zarr_format=3)
