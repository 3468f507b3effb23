"""What becomes of a store whose writer is killed, or whose disk is full, at each step of writing."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from kine2go_warp.dataset.staging import StagingArea
from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.robots import GO2
from tests.conftest import REPOSITORY
from tests.dataset.helpers import assert_it_is_complete, assert_it_opens, files_of, small_disk
from tests.dataset.test_store import SIMULATION, made_up
from tests.dataset.write_process import write


def write_older(store: Path) -> None:
    """The store before: another motion ``one``, and ``two``."""
    writer = DatasetWriter(store, GO2)
    for seed, motion in ((2, "one"), (3, "two")):
        writer.write(motion, made_up(np.random.default_rng(seed)), SIMULATION, {"rejected": {}})


def kill_at_each_step(folder: Path, kind: str, first: int = 1, stride: int = 1) -> list[Path]:
    """Returns the stores whose writers were killed, in the order of the steps."""
    module = "tests.dataset.write_process"
    command = [sys.executable, "-m", module, str(folder), kind, str(first), str(stride)]
    subprocess.run(command, check=True, cwd=REPOSITORY)
    found = sorted(folder.glob("step-*"), key=lambda path: int(path.name.partition("-")[2]))
    return [path / "dataset.zarr" for path in found[:-1]]


def assert_replacing_loses_nothing(stores: list[Path], before: Path) -> None:
    old, other = files_of(before / "one"), files_of(before / "two")
    reference = before.with_name("reference")
    write_older(reference)
    write(reference)
    new = files_of(reference / "one")
    seen = set()
    for store in stores:
        names = assert_it_opens(store)
        assert files_of(store / "two") == other
        if "one" in names:
            assert files_of(store / "one") in (old, new)
        else:
            aside = [one for one in StagingArea(store).leftovers() if one.kind == "old"]
            assert [files_of(one.folder) for one in aside] == [old]
        DatasetWriter(store, GO2)
        assert_it_is_complete(store, ["one", "two"])
        kept = files_of(store / "one")
        assert kept in (old, new)
        assert kept == files_of(store / "one") if "one" in names else kept == old
        seen.add(("one" in names, kept == new))
        write(store)
        assert files_of(store) == files_of(reference)
    assert {(True, False), (True, True)} <= seen


@pytest.mark.parametrize("stride", [3, pytest.param(1, marks=pytest.mark.faults)])
def test_a_kill_at_any_step_of_replacing_a_motion_loses_neither_it_nor_another(tmp_path, stride):
    write_older(tmp_path / "before")
    stores = kill_at_each_step(tmp_path, "outer", stride=stride)
    assert len(stores) > 10 // stride
    assert_replacing_loses_nothing(stores, tmp_path / "before")


@pytest.mark.faults
def test_a_kill_inside_the_folder_that_is_prepared_or_deleted_loses_nothing(tmp_path):
    write_older(tmp_path / "before")
    stores = kill_at_each_step(tmp_path, "all", first=3, stride=15)
    assert len(stores) > 30
    assert_replacing_loses_nothing(stores, tmp_path / "before")


@pytest.mark.faults
def test_a_kill_at_any_step_of_creating_a_store_leaves_none_or_one_that_opens(tmp_path):
    stores = kill_at_each_step(tmp_path, "outer")
    assert len(stores) > 5
    write(tmp_path / "reference" / "dataset.zarr")
    for store in stores:
        if store.exists():
            assert assert_it_opens(store) in ([], ["one"])
        write(store)
        assert_it_is_complete(store, ["one"])
        assert files_of(store) == files_of(tmp_path / "reference" / "dataset.zarr")


@pytest.mark.parametrize("kilobytes", [0, 8, 200, 560, 620, 680, 740])
def test_a_disk_that_is_full_after_so_many_kilobytes_leaves_the_old_motion_or_the_new_one(tmp_path, kilobytes):
    with small_disk(tmp_path / "disk", 8) as disk:
        store = disk.folder / "dataset.zarr"
        write_older(store)
        old, other = files_of(store / "one"), files_of(store / "two")
        disk.leave(kilobytes * 1024)
        try:
            write(store)
            failed = False
        except OSError as error:
            assert "No space left" in str(error)  # noqa: PT017 - which sizes fail depends on the file system
            failed = True
        assert failed or kilobytes > 500
        assert sorted(path.name for path in disk.folder.iterdir()) == ["dataset.zarr", "filler"]
        assert assert_it_opens(store) == ["one", "two"]
        assert files_of(store / "two") == other
        if failed and kilobytes < 500:
            assert files_of(store / "one") == old
        disk.free()
        write(store)
        assert_it_is_complete(store, ["one", "two"])


def test_a_rename_that_fails_puts_the_old_motion_back(tmp_path, monkeypatch):
    store = tmp_path / "dataset.zarr"
    write_older(store)
    old, rename = files_of(store / "one"), Path.rename

    def fail_for_new(path, target):
        if "-new-" in path.name:
            raise OSError(28, "No space left on device")
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", fail_for_new)
    with pytest.raises(OSError, match="No space"):
        write(store)
    monkeypatch.undo()
    assert files_of(store / "one") == old
    DatasetWriter(store, GO2)
    assert_it_is_complete(store, ["one", "two"])


def test_what_another_living_process_has_beside_the_store_stays(tmp_path):
    store = tmp_path / "dataset.zarr"
    write_older(store)
    area = StagingArea(store)
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as other:
        theirs = store.with_name(area.folder("spool", "three").name.replace(f"-{os.getpid()}-", f"-{other.pid}-"))
        theirs.mkdir()
        assert area.recover()
        assert theirs.exists()
        other.communicate(b"\n")
    assert not area.recover()
    assert not theirs.exists()


def test_names_of_stores_and_motions_that_look_like_leftovers_are_told_apart(tmp_path):
    """A motion ``old-one`` that is being written is not a motion ``one`` that was set aside."""
    store = tmp_path / "data"
    write_older(store)
    area = StagingArea(store)
    area.folder("new", "old-three").mkdir()
    StagingArea(tmp_path / "data-old").folder("old", "four").mkdir()
    assert [(one.kind, one.motion) for one in area.leftovers()] == [("new", "old-three")]
    area.recover()
    assert DatasetWriter(store, GO2).motions() == ["one", "two"]
