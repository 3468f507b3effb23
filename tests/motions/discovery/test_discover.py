"""From long recordings to a catalogue, a contact sheet and clips."""

import re

import numpy as np
import pytest

from kine2go_warp.cli.main import main
from kine2go_warp.motions.catalogue import own_catalogue
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.motions.discovery import discover as module
from kine2go_warp.motions.discovery.cuts import cuts
from kine2go_warp.motions.discovery.likeness import unique_time
from kine2go_warp.motions.discovery.recording import read_recording
from kine2go_warp.motions.generator import PACE, TROT, DogGait, generate, write_ai4animation
from kine2go_warp.motions.own_file import OwnFile
from kine2go_warp.motions.quality import distance_to_hull
from kine2go_warp.pipelines.recipe import load_recipe
from kine2go_warp.robots import GO2

GAITS = (
    DogGait(TROT, stride_frames=32, speed=0.9, turn_rate=0.4, brisk=True),
    DogGait(PACE, 36, speed=1.0, brisk=True),
)


def animal(gait, rng, num_frames=200, noise=0.003):
    """A gait in which no two strides are the same: the points sway slowly."""
    points = generate(gait, num_frames).points
    knots = rng.normal(0.0, noise, (num_frames // 20 + 2, *points.shape[1:]))
    places = np.arange(num_frames) / 20.0
    before = places.astype(int)
    share = (places - before)[:, None, None]
    return points + (1.0 - share) * knots[before] + share * knots[before + 1]


@pytest.fixture
def recordings(tmp_path, rng, monkeypatch):
    """A trot, a pace, and a stand."""
    monkeypatch.chdir(tmp_path)
    still = np.repeat(generate(GAITS[0], 1).points, 150, axis=0)
    for name, gait in zip(("trot", "pace"), GAITS, strict=True):
        write_ai4animation(animal(gait, rng), tmp_path / f"{name}.txt")
    write_ai4animation(still, tmp_path / "still.txt")
    return ["trot.txt", "pace.txt", "still.txt"]


DISCOVER = ["motion", "discover", "--licence", "CC BY 4.0", "--citation", "me", "--out", "found.toml"]


def test_recordings_become_a_catalogue_whose_ranges_are_those_of_the_clips(recordings, tmp_path, capsys):
    assert main([*DISCOVER, *recordings]) == 0, capsys.readouterr().err
    printed = capsys.readouterr().out
    entries = own_catalogue(tmp_path / "found.toml")
    assert {"trot_trot", "pace_pace", "still_stand"} <= {name.rpartition("_")[0] for name in entries}, list(entries)
    assert "near duplicates left out" in printed
    assert {entry.kind for name, entry in entries.items() if "stand" in name} == {"once"}
    assert main(["motion", "retarget", "--all", "--catalogue", "found.toml", "--out", "clips"]) == 0
    for name, entry in entries.items():
        clip = MotionClip.load(tmp_path / "clips" / f"{name}.npz")
        assert (clip.origin.start, clip.origin.end) == (entry.frames.start, entry.frames.end), name
        assert (clip.origin.licence, clip.origin.citation) == ("CC BY 4.0", "me")
    assert load_recipe(tmp_path / "found.toml").motions == tuple(entries)


def test_the_contact_sheet_has_each_motion_and_asks_no_network(recordings, tmp_path, capsys):
    assert main([*DISCOVER, *recordings]) == 0, capsys.readouterr().err
    page = (tmp_path / "found.html").read_text()
    names = list(own_catalogue(tmp_path / "found.toml"))
    assert page.count("<article>") == len(names)
    assert all(f"<h2>{name}</h2>" in page for name in names)
    assert page.count('aria-label="footfall diagram"') == len(names)
    assert not re.search(r"https?:|src=|url\(|@import|<script", page)
    assert "default-src 'none'" in page


@pytest.mark.usefixtures("recordings")
def test_mirrored_twins_are_motions_of_their_own(tmp_path, capsys):
    assert main([*DISCOVER, "trot.txt", "--mirrored"]) == 0, capsys.readouterr().err
    entries = own_catalogue(tmp_path / "found.toml")
    names = [name for name, entry in entries.items() if not entry.mirrored]
    assert list(entries) == [one for name in names for one in (name, f"{name}_mirrored")]
    assert load_recipe(tmp_path / "found.toml").motions == tuple(entries)
    assert main(["motion", "retarget", *list(entries)[:2], "--catalogue", "found.toml", "--out", "clips"]) == 0
    clip, twin = (MotionClip.load(tmp_path / "clips" / f"{name}.npz") for name in list(entries)[:2])
    assert clip.cycle is not None
    assert twin.cycle is not None
    assert (twin.cycle.x, twin.cycle.y, twin.cycle.yaw) == (clip.cycle.x, -clip.cycle.y, -clip.cycle.yaw)
    assert clip.cycle.yaw > 0.1


@pytest.mark.usefixtures("recordings")
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "name at least one motion file"),
        (["nothing.txt"], "nothing.txt: no such motion file"),
        (["trot.txt", "trot.txt"], "trot.txt is named twice"),
        (["trot.txt", "--licence", ""], "--licence"),
        (["trot.txt", "--rate", "-1"], "--rate"),
        (["trot.txt", "--source", "cat"], "unknown motion source 'cat'"),
        (["trot.txt", "--out", "taken.toml"], "taken.toml: is there already"),
    ],
)
def test_wrong_input_ends_with_one_line_and_no_file(tmp_path, capsys, arguments, message):
    taken = tmp_path / "taken.toml"
    taken.write_text("mine")
    before = sorted(tmp_path.iterdir())
    assert main([*DISCOVER, *arguments]) == 2
    error = capsys.readouterr().err.strip()
    assert message in error
    assert len(error.splitlines()) == 1
    assert sorted(tmp_path.iterdir()) == before
    assert taken.read_text() == "mine"


def test_an_interrupted_search_leaves_nothing(recordings, tmp_path, monkeypatch, capsys):
    def interrupt(*_):
        raise KeyboardInterrupt

    before = sorted(tmp_path.iterdir())
    monkeypatch.setattr(module, "retarget", interrupt)
    assert main([*DISCOVER, *recordings]) == 130
    assert "interrupted" in capsys.readouterr().err
    assert sorted(tmp_path.iterdir()) == before


def test_a_copy_of_a_recording_at_another_rate_adds_no_unique_minutes(tmp_path, rng):
    points = animal(GAITS[0], rng, 400)
    write_ai4animation(points, tmp_path / "a.txt")
    # Cut elsewhere, turned, moved, and with the noise of another export.
    copy = points[33:] @ np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]) + [3.0, -1.0, 0.0]
    write_ai4animation(copy + rng.normal(0.0, 5e-4, copy.shape), tmp_path / "b.txt")
    write_ai4animation(animal(GAITS[1], rng, 400), tmp_path / "c.txt")
    first, second, third = (read_recording(OwnFile(tmp_path / f"{name}.txt", "own"), GO2) for name in "abc")
    alone = unique_time([first])
    assert alone > 0.9 * first.duration
    assert unique_time([first, second]) == pytest.approx(alone, abs=0.03 * first.duration)
    assert unique_time([first, second, third]) == pytest.approx(alone + unique_time([third]), rel=0.03)


def test_strides_that_hardly_differ_are_one_motion_and_another_speed_is_not(tmp_path, rng, solver):
    files = []
    for index, speed in enumerate((0.9, 0.9, 1.3)):
        path = tmp_path / f"dog{index}.txt"
        write_ai4animation(animal(DogGait(TROT, 32, speed=speed, brisk=True), rng, 150), path)
        files.append(OwnFile(path, "own"))
    found = module.discover(files, solver, lambda *_: None, is_checked=False)
    cycles = [one.cut for one in found.motions if one.cut.kind == "cycle"]
    assert len(cycles) == 2, [one.name for one in found.motions]
    assert found.duplicates >= 4
    assert sorted(one.gait.speed for one in cycles) == pytest.approx([0.9 * 0.825, 1.3 * 0.825], rel=0.03)


def test_changes_of_posture_are_played_once_from_a_hold(data_folder):
    path = data_folder / "ai4animation" / "dog_walk00_joint_pos.txt"
    if not path.is_file():
        pytest.skip(f"no real clip {path}")
    found = [one for one in cuts(read_recording(OwnFile(path, "test"), GO2)) if one.kind == "once"]
    # Seen in drawings: it sits until frame 45, and walks from 95 on.
    assert [(one.label, one.gait.postures) for one in found] == [("rise", ("sit", "up"))]
    assert 20 <= found[0].start <= 45
    assert 80 <= found[0].end <= 120


@pytest.mark.slow
def test_ten_recordings_of_dogs_hold_sixty_motions_that_fit_the_robot(data_folder, solver):
    paths = sorted((data_folder / "ai4animation").glob("dog_*.txt"))
    if len(paths) != 10:
        pytest.skip(f"no ten recordings in {data_folder / 'ai4animation'}")
    found = module.discover([OwnFile(path, "test") for path in paths], solver, lambda *_: None)
    assert len(found.motions) >= 60
    assert len({one.name for one in found.motions}) == len(found.motions)
    assert {"walk", "trot", "pace", "gallop", "turn", "strafe"} <= {one.cut.label for one in found.motions}
    assert 0.5 * found.recorded_time < found.unique_time < found.recorded_time


def test_without_feet_on_the_floor_nothing_bears_the_base():
    assert distance_to_hull(np.empty((0, 2))) == np.inf
    assert distance_to_hull(np.array([[0.3, 0.4]])) == pytest.approx(0.5, abs=1e-4)
