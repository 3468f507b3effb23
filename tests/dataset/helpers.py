"""What the tests of kills and full disks share."""

import contextlib
import shutil
import subprocess
import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest
import xarray

from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.checks.store import check_index
from kine2go_warp.dataset.store import motion_names


def files_of(folder: Path) -> dict[str, bytes]:
    """Everything in a folder, byte for byte."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def assert_it_opens(store: Path) -> list[str]:
    """A store opens with everything that we have, whatever happened to its writer; returns its motions."""
    names = motion_names(store)
    with warnings.catch_warnings():
        # After a kill it may lack the index, of which xarray complains.
        warnings.simplefilter("ignore", RuntimeWarning)
        tree = xarray.open_datatree(store, engine="zarr")
    assert sorted(tree.children) == names
    for name in names:
        open_dataset(store, include_rejected=True).load(name)
    return names


def assert_it_is_complete(store: Path, names: list[str]) -> None:
    """A store has these motions and an index of them, and nothing lies beside it."""
    assert motion_names(store) == names
    assert '"consolidated_metadata"' in (store / "zarr.json").read_text()
    assert list(check_index(store)) == []
    assert [path.name for path in store.parent.iterdir()] == [store.name]


class SmallDisk:
    """A file system of a few megabytes of which a filler takes as much as is wanted."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.filler = folder, folder / "filler"

    def leave(self, num_bytes: int) -> None:
        """Leave so many bytes free."""
        self.filler.unlink(missing_ok=True)
        self.filler.write_bytes(bytes(shutil.disk_usage(self.folder).free - num_bytes))

    def free(self) -> None:
        """Leave everything free."""
        self.filler.unlink(missing_ok=True)


@contextlib.contextmanager
def small_disk(folder: Path, megabytes: int) -> Iterator[SmallDisk]:
    """Mount a small file system in memory; skip the test where that is not allowed."""
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", f"size={megabytes}m", "tmpfs", str(folder)]
    if shutil.which("mount") is None or subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip("mounting a file system is not allowed here")
    try:
        yield SmallDisk(folder)
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)
