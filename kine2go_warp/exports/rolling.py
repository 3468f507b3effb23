"""Parquet files that begin anew when they are large, numbered as LeRobot numbers them."""

from pathlib import Path
from types import TracebackType
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

FILES_A_CHUNK = 1000
"""Files in a folder, LeRobot's ``chunks_size``."""
FILE_MEGABYTES = 100
"""Size at which the next file begins, LeRobot's ``data_files_size_in_mb``."""
PATH_TEMPLATE = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"


class RollingParquet:
    """Writes tables one after the other, each a row group. Use it as a context manager."""

    def __init__(self, folder: Path, file_bytes: int = FILE_MEGABYTES * 2**20) -> None:
        """Prepare to write, after the files that are there.

        Args:
            folder: Where ``chunk-000/file-000.parquet`` and so on will be.
            file_bytes: Size at which the next file begins.
        """
        self.folder, self.file_bytes = folder, file_bytes
        self._number = sum(1 for _ in folder.rglob("*.parquet")) - 1
        self._file: pa.NativeFile | None = None
        self._writer: pq.ParquetWriter | None = None

    def __enter__(self) -> "RollingParquet":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._close()

    def place(self) -> tuple[int, int]:
        """Return the numbers of chunk and file into which the next table goes."""
        full = self._file is None or self._file.tell() >= self.file_bytes
        return divmod(self._number + full, FILES_A_CHUNK)

    def write(self, table: pa.Table) -> None:
        """Write a table as one row group."""
        chunk, file = self.place()
        number = chunk * FILES_A_CHUNK + file
        if number != self._number:
            self._close()
            self._number = number
            path = self.folder / PATH_TEMPLATE.format(chunk_index=chunk, file_index=file)
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = pa.OSFile(str(path), "wb")
            self._writer = pq.ParquetWriter(self._file, table.schema, compression="snappy", use_dictionary=False)
        assert self._writer is not None
        self._writer.write_table(table, row_group_size=max(table.num_rows, 1))

    def _close(self) -> None:
        if self._writer is not None:
            self._writer.close()
        if self._file is not None:
            self._file.close()
        self._writer = self._file = None


def as_table(columns: dict[str, NDArray[Any]]) -> pa.Table:
    """Return columns as lists of fixed size; those of shape [num_rows] or [num_rows, 1] as plain numbers."""
    arrays = {}
    for name, values in columns.items():
        flat = pa.array(values.reshape(-1))
        width = 1 if values.ndim == 1 else values.shape[1]
        arrays[name] = flat if width == 1 else pa.FixedSizeListArray.from_arrays(flat, width)
    return pa.table(arrays)
