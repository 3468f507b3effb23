"""Shards that are written without Zarr: Zarr would write the same bytes, and reads them."""

from pathlib import Path

import numpy as np
import pytest
import zarr

from kine2go_warp.dataset.schema import ArraySpec
from kine2go_warp.dataset.shards import RowArray, write_row_arrays
from kine2go_warp.dataset.writer import create_array
from tests.dataset.helpers import files_of

FORCES = ArraySpec("force", ("trajectory", "frame", "foot"), "N", "", "float32")
PHASE = ArraySpec("phase", ("trajectory", "frame"), "1", "", "float32")


@pytest.mark.parametrize("count", [1, 3, 64, 150])
def test_the_bytes_are_those_that_zarr_writes(tmp_path, rng, count):
    rows = {FORCES: rng.normal(size=(count, 20, 4)).astype(np.float32), PHASE: rng.uniform(size=(count, 20))}
    rows[FORCES][0, 5:] = np.nan
    ours, theirs = (zarr.open_group(tmp_path / name, mode="w", zarr_format=3) for name in ("ours", "theirs"))
    arrays = []
    for spec, values in rows.items():
        create_array(theirs, spec, values.shape, np.dtype("float32"))[...] = values
        target = create_array(ours, spec, values.shape, np.dtype("float32"))
        arrays.append(
            RowArray(target, tmp_path / "ours" / spec.name, lambda first, last, values=values: values[first:last])
        )
    write_row_arrays(arrays)
    assert files_of(tmp_path / "ours") == files_of(tmp_path / "theirs")
    np.testing.assert_array_equal(ours["force"][...], rows[FORCES])


def test_rows_that_cannot_be_read_end_the_writing(tmp_path):
    group = zarr.open_group(tmp_path, mode="w", zarr_format=3)
    target = create_array(group, PHASE, (200, 20), np.dtype("float32"))

    def read(first: int, last: int) -> np.ndarray:
        raise OSError(f"rows {first} to {last} are lost")

    with pytest.raises(OSError, match="rows 0 to 64 are lost"):
        write_row_arrays([RowArray(target, Path(tmp_path) / "phase", read)])
