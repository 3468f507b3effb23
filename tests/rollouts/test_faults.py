"""Gathering loses nothing: not by a kill at any moment, not by a full disk."""

import shutil
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest

from kine2go_warp.cli.main import main
from kine2go_warp.dataset.checks.run import check_dataset
from kine2go_warp.dataset.staging import StagingArea
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.robots import GO2
from tests.conftest import ANYTHING_GOES
from tests.dataset.helpers import assert_it_is_complete, assert_it_opens, files_of, small_disk
from tests.killing import KillableWorker, spread_moments
from tests.rollouts.gather_process import MOTIONS


@pytest.fixture(scope="module")
def policies(policy, tmp_path_factory):
    """The policy under two names."""
    folder = tmp_path_factory.mktemp("policies")
    record = policy.read_record()
    clip = policy.read_clips(record)[0]
    for name in MOTIONS:
        copy = PolicyFolder(Path(shutil.copytree(policy.path, folder / name)))
        renamed = replace(clip, name=name)
        hashes = (renamed.content_hash(),)
        copy.write_record(replace(record, clips=copy.write_clips((renamed,)), clip_hashes=hashes))
    return folder


def kill_at_random_moments(policies: Path, folder: Path, kills: int) -> None:
    """Kill gathering; every second time it replaces motions that were gathered with another seed."""
    reference, older = folder / "reference" / "dataset.zarr", folder / "older" / "dataset.zarr"
    with KillableWorker("tests.rollouts.gather_process", policies, reference) as gatherer:
        assert gatherer.ask(older, 1)[0] == 0
        again, landed = folder / "again" / "dataset.zarr", Counter()
        status, life = gatherer.ask(again, 0)
        assert (status, files_of(again)) == (0, files_of(reference)), "undisturbed runs agree"
        assert check_dataset(reference, GO2).is_clean
        whole = {name: [files_of(path / name) for path in (reference, older)] for name in MOTIONS}
        for number, moment in enumerate(spread_moments(kills)):
            store = folder / str(number) / "dataset.zarr"
            if number % 2:
                shutil.copytree(older, store)
            status, seconds = gatherer.ask(store, 0, kill_after=life * moment)
            if not status:
                # The machine has become faster since the life was measured.
                life = min(life, seconds)
            landed[stage_of(store) if status else "after the end"] += 1
            if store.exists():
                assert_the_rest_is_whole(store, whole, replacing=bool(number % 2))
            assert gatherer.ask(store, 0)[0] == 0
            assert_it_is_complete(store, list(MOTIONS))
            assert files_of(store) == files_of(reference), "the next run completes it with the same bits"
            shutil.rmtree(store.parent)
    print(f"{kills} kills over {life:.1f} s: {dict(landed)}")
    assert landed["after the end"] <= kills // 2


def stage_of(store: Path) -> str:
    """What gathering was at when it was killed, told by what it has left."""
    left = {one.kind for one in StagingArea(store).leftovers()}
    return "writing" if left - {"spool"} else "gathering" if left else "other"


def assert_the_rest_is_whole(store: Path, whole: dict[str, list[dict[str, bytes]]], replacing: bool) -> None:
    """A store opens after a kill, and each motion in it, or set aside, is one of those that were written whole."""
    names = assert_it_opens(store)
    aside = {one.motion: one.folder for one in StagingArea(store).leftovers() if one.kind == "old"}
    for name in MOTIONS if replacing else names:
        assert files_of(store / name if name in names else aside[name]) in whole[name]
    assert not names or check_dataset(store, GO2).is_clean


def test_gathering_that_is_killed_at_any_moment_loses_nothing(policies, tmp_path):
    kill_at_random_moments(policies, tmp_path, 2)


@pytest.mark.faults
def test_gathering_that_is_killed_at_any_of_fifty_moments_loses_nothing(policies, tmp_path):
    kill_at_random_moments(policies, tmp_path, 50)


def arguments(policy: Path, store: Path) -> list[str]:
    """The command that gathers a few short rollouts."""
    limits = [text for name, value in ANYTHING_GOES.items() for text in (f"--{name.replace('_', '-')}", str(value))]
    seed = str(MOTIONS.index(policy.name))
    return ["gather", str(policy), "--out", str(store), "--device", "cpu", "--trajectories", "4", "--rows", "24",
            "--seed", seed, *limits]  # fmt: skip


def assert_it_says_that_the_disk_is_full(status: int, errors: str) -> None:
    assert status == 2
    said = [line for line in errors.splitlines() if not line.startswith("dog_trot")]
    assert len(said) == 1, errors
    assert said[0].startswith("kine2go: error: ")
    assert "no space left on the disk; free some and run the same command again" in said[0]


def test_a_full_disk_is_said_in_one_line_and_the_same_command_completes_later(policies, tmp_path, capfd):
    with small_disk(tmp_path / "disk", 8) as disk:
        store = disk.folder / "dataset.zarr"
        first, second = (arguments(policies / name, store) for name in MOTIONS)
        assert main(first) == 0
        before = files_of(store / MOTIONS[0])
        # Too little for the rows on their way, then for the motion as it is written.
        for kilobytes in (40, 400):
            disk.leave(kilobytes * 1024)
            capfd.readouterr()
            assert_it_says_that_the_disk_is_full(main(second), capfd.readouterr().err)
            assert sorted(path.name for path in disk.folder.iterdir()) == ["dataset.zarr", "filler"]
            assert assert_it_opens(store) == [MOTIONS[0]]
            assert files_of(store / MOTIONS[0]) == before
        disk.free()
        assert main(second) == 0
        assert_it_is_complete(store, list(MOTIONS))
        assert check_dataset(store, GO2).is_clean


@pytest.mark.parametrize(
    "place",
    ["kine2go_warp.rollouts.row_writer.AsyncRowWriter._write_block", "kine2go_warp.dataset.writer.write_members"],
)
def test_an_error_of_the_disk_is_said_in_one_line_wherever_it_occurs(policies, tmp_path, capfd, monkeypatch, place):
    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(place, fail)
    status = main(arguments(policies / MOTIONS[0], tmp_path / "dataset.zarr"))
    assert_it_says_that_the_disk_is_full(status, capfd.readouterr().err)
    assert list(tmp_path.iterdir()) == []
