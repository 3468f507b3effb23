"""Files and folders appear whole or not at all."""

import os
import platform
import subprocess
import sys

import pytest

from kine2go_warp.files import atomic_file, atomic_folder, check_place


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def half_a_file(path):
    with atomic_file(path) as temporary:
        temporary.write_text("ne")
        raise KeyboardInterrupt


def half_a_folder(path):
    with atomic_folder(path) as temporary:
        (temporary / "half").write_text("1")
        raise KeyboardInterrupt


def test_a_file_appears_when_it_is_whole(tmp_path):
    path = tmp_path / "new" / "figures.json"
    with atomic_file(path) as temporary:
        temporary.write_text("1")
        assert not path.exists()
    assert path.read_text() == "1"
    assert names(path.parent) == ["figures.json"]


def test_a_file_stays_as_it_was_if_writing_is_interrupted(tmp_path):
    path = tmp_path / "figures.json"
    path.write_text("old")
    with pytest.raises(KeyboardInterrupt):
        half_a_file(path)
    assert path.read_text() == "old"
    assert names(tmp_path) == ["figures.json"]


def test_a_folder_replaces_the_older_one_when_it_is_whole(tmp_path):
    for content in ("old", "new"):
        with atomic_folder(tmp_path / "export") as temporary:
            assert names(temporary) == []
            (temporary / content).write_text("1")
    assert names(tmp_path / "export") == ["new"]
    assert names(tmp_path) == ["export"]


def test_a_folder_is_not_there_if_writing_is_interrupted(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        half_a_folder(tmp_path / "export")
    assert names(tmp_path) == []


def test_a_folder_stays_as_it_was_if_writing_is_interrupted(tmp_path):
    (tmp_path / "export" / "old").mkdir(parents=True)
    with pytest.raises(KeyboardInterrupt):
        half_a_folder(tmp_path / "export")
    assert names(tmp_path) == ["export"]
    assert names(tmp_path / "export") == ["old"]


def test_what_a_killed_process_left_is_removed_by_the_next(tmp_path):
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    for process, content in ((gone.pid, "left"), (os.getppid(), "of a living process")):
        (tmp_path / f".tmp-{platform.node()}-{process}-figures.json").write_text(content)
    (tmp_path / f".tmp-elsewhere-{gone.pid}-figures.json").write_text("of another machine")
    folder = tmp_path / f".tmp-{platform.node()}-{gone.pid}-data"
    folder.mkdir()
    with atomic_file(tmp_path / "figures.json") as temporary:
        temporary.write_text("1")
    with atomic_folder(tmp_path / "data"):
        pass
    assert set(names(tmp_path)) == {
        f".tmp-elsewhere-{gone.pid}-figures.json",
        f".tmp-{platform.node()}-{os.getppid()}-figures.json",
        "data",
        "figures.json",
    }


@pytest.mark.parametrize("place", ["file/x/a.json", "loop/a.json", "x" * 300, "/proc/kine2go/a.json"])
def test_a_place_that_cannot_be_written_is_found_before_the_work(place, tmp_path):
    (tmp_path / "file").write_text("mine")
    (tmp_path / "loop").symlink_to("loop")
    with pytest.raises(OSError, match=r"Not a directory|Too many levels|name too long|No such file"):
        check_place(tmp_path / place)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "loop"]


def test_a_place_that_is_yet_to_be_made_can_be_written(tmp_path):
    check_place(tmp_path / "new" / "folder" / "a.json")
    check_place(tmp_path)
    assert list(tmp_path.iterdir()) == []
