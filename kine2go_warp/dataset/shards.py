"""Writes the rows of many trajectories as shards of Zarr arrays, in threads.

Zarr compresses one chunk at a time through its event loop, which takes several times as long as compressing for
chunks of some kilobytes. The bytes are the same.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import google_crc32c
import numpy as np
import zarr
from numcodecs.zstd import Zstd
from numpy.typing import NDArray
from zarr.codecs import ZstdCodec

from kine2go_warp.machine import in_threads

SHARD_TRAJECTORIES = 64
"""Most trajectories in one file of an array, and so in memory while it is written."""

LEVEL = 3
"""Of the compression."""

COMPRESSOR = ZstdCodec(level=LEVEL, checksum=True)
"""Compressor of the chunks, as Zarr's metadata record it."""

_NO_CHUNK = np.iinfo(np.uint64).max
"""Offset and length in a shard's index where there is no chunk."""


@dataclass(frozen=True)
class RowArray:
    """An array with a chunk a trajectory, and what goes into it."""

    target: zarr.Array[Any]
    """Created for shards of up to ``SHARD_TRAJECTORIES`` chunks, compressed by ``COMPRESSOR``."""
    folder: Path
    """Of the array."""
    read: Callable[[int, int], NDArray[Any]]
    """Return the rows of the trajectories from one to before another, shape [count, num_rows, ...]."""

    def write_shard(self, first: int) -> None:
        """Write the file of the trajectories from ``first`` on."""
        assert self.target.shards is not None
        size = self.target.shards[0]
        values = np.ascontiguousarray(self.read(first, min(first + size, self.target.shape[0])), self.target.dtype)
        codec = Zstd(level=LEVEL, checksum=True)
        path = self.folder.joinpath("c", str(first // size), *("0" for _ in values.shape[1:]))
        path.parent.mkdir(parents=True)
        path.write_bytes(shard([codec.encode(chunk) for chunk in values], size))


def shard(chunks: list[bytes], size: int) -> bytes:
    """Return a shard: chunks, then where each of up to ``size`` begins and how long it is, then a checksum of that."""
    lengths = np.array([len(chunk) for chunk in chunks], np.uint64)
    index = np.full((size, 2), _NO_CHUNK, "<u8")
    index[: len(chunks)] = np.stack([np.cumsum(lengths) - lengths, lengths], axis=1)
    checksum = google_crc32c.value(index.tobytes()).to_bytes(4, "little")
    return b"".join([*chunks, index.tobytes(), checksum])


def write_row_arrays(arrays: Iterable[RowArray]) -> None:
    """Write every shard of some arrays, as many at a time as there are cores.

    Raises:
        OSError: a file could not be written.
    """

    def write(job: tuple[RowArray, int]) -> None:
        array, first = job
        array.write_shard(first)

    jobs = [(array, first) for array in arrays for first in range(0, array.target.shape[0], SHARD_TRAJECTORIES)]
    for _ in in_threads(write, jobs):
        pass
