"""Where recorded rows go: to the disk, in a thread so that the simulation does not wait, or into memory."""

import queue
import shutil
import threading
import time
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Protocol

import numpy as np
import torch
from numpy.typing import NDArray

QUEUED_BLOCKS = 3
"""Blocks that may wait, besides the one that is being written, before the simulation waits, too."""


class RowStore(Protocol):
    """Takes blocks of rows and returns them by array and world; see ``AsyncRowWriter``."""

    def submit(self, blocks: dict[str, torch.Tensor], ready: torch.cuda.Event | None) -> None:
        """Take some rows."""
        ...

    def close(self) -> None:
        """Take no more."""
        ...

    def read(self, name: str, worlds: NDArray[Any]) -> NDArray[Any]:
        """Return the rows of some worlds, shape [len(worlds), num_rows, ...]."""
        ...

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the arrays."""
        ...


class RowMemory:
    """Keeps rows in memory, for a few short rollouts."""

    def __init__(self) -> None:
        self._blocks: dict[str, list[NDArray[Any]]] = {}

    def submit(self, blocks: dict[str, torch.Tensor], ready: torch.cuda.Event | None) -> None:
        """Take some rows of all arrays; see ``AsyncRowWriter.submit``."""
        if ready is not None:
            ready.synchronize()
        for name, block in blocks.items():
            self._blocks.setdefault(name, []).append(block.numpy())

    def close(self) -> None:
        """Nothing is left to write."""

    def read(self, name: str, worlds: NDArray[Any]) -> NDArray[Any]:
        """Return the rows of some worlds, shape [len(worlds), num_rows, ...]."""
        return np.moveaxis(np.concatenate([block[:, worlds] for block in self._blocks[name]]), 0, 1)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the arrays."""
        return tuple(self._blocks)


class AsyncRowWriter:
    """Files of rows, one an array, in the order in which they were simulated: [num_rows, num_worlds, ...].

    A file is written once from its beginning to its end, which is what disks do best; a full disk is an error of the
    writing thread, which the next ``submit`` or ``close`` raises. Use it as a context manager: the thread ends with it.
    """

    def __init__(self, folder: Path) -> None:
        """Remove what is in the folder and start the thread."""
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        self.folder = folder
        self.waited = 0.0
        """Time for which the simulation has waited for the disk [s]."""
        self.num_bytes = 0
        """Bytes submitted."""
        self._layout: dict[str, tuple[np.dtype, tuple[int, ...]]] = {}
        self._is_given_up = False
        self._queue: queue.Queue[Any] = queue.Queue(QUEUED_BLOCKS)
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._write, name="kine2go row writer", daemon=True)
        self._thread.start()

    def __enter__(self) -> "AsyncRowWriter":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._is_given_up = error is not None
        self._end_thread()

    def submit(self, blocks: dict[str, torch.Tensor], ready: torch.cuda.Event | None) -> None:
        """Queue some rows of all arrays, each of shape [num_rows, num_worlds, ...], in memory of the host.

        Args:
            blocks: The rows; they must not change any more.
            ready: On a GPU, what to wait for before they are there.

        Raises:
            OSError: an earlier block could not be written.
        """
        started = time.perf_counter()
        self._queue.put((blocks, ready))
        self.waited += time.perf_counter() - started
        self._raise_error()

    def close(self) -> None:
        """Wait until everything is written.

        Raises:
            OSError: a block could not be written.
        """
        started = time.perf_counter()
        self._end_thread()
        self.waited += time.perf_counter() - started
        self._raise_error()

    def read(self, name: str, worlds: NDArray[Any]) -> NDArray[Any]:
        """Return the rows of some worlds, shape [len(worlds), num_rows, ...]."""
        dtype, shape = self._layout[name]
        rows = np.memmap(self.folder / name, dtype=dtype, mode="r").reshape(-1, *shape)
        return np.moveaxis(rows[:, worlds], 0, 1)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the arrays."""
        return tuple(self._layout)

    def _raise_error(self) -> None:
        """Raise what went wrong in the thread."""
        if self._error is not None:
            raise self._error

    def _end_thread(self) -> None:
        """Let the thread write what is queued and end."""
        if self._thread.is_alive():
            self._queue.put(None)
            self._thread.join()

    def _write(self) -> None:
        """Write blocks until None comes; after an error drop them, so that ``submit`` never waits for a full queue."""
        files: dict[str, BinaryIO] = {}
        while (item := self._queue.get()) is not None:
            if self._error is None and not self._is_given_up:
                try:
                    self._write_block(files, *item)
                except Exception as error:  # noqa: BLE001 - whatever it is, the simulation raises it
                    self._error = error
        for file in files.values():
            try:
                file.close()
            except OSError as error:
                self._error = self._error or error

    def _write_block(
        self, files: dict[str, BinaryIO], blocks: dict[str, torch.Tensor], ready: torch.cuda.Event | None
    ) -> None:
        """Append some rows to the file of each array."""
        if ready is not None:
            ready.synchronize()
        for name, block in blocks.items():
            values = block.numpy()
            if name not in files:
                files[name] = (self.folder / name).open("wb")
                self._layout[name] = (values.dtype, values.shape[1:])
            files[name].write(np.ascontiguousarray(values).data)
            self.num_bytes += values.nbytes
