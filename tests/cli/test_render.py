"""``kine2go dataset render`` as a person meets it."""

import shutil

import numpy as np
import pytest
import zarr
from PIL import Image

from kine2go_warp.cli.main import main
from kine2go_warp.cli.render_command import parsed_size


def failing(capsys, *arguments):
    """Run a command that must fail, and return its one line."""
    assert main(["render", *map(str, arguments)]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    return lines[0]


@pytest.mark.usefixtures("can_draw")
def test_a_video_is_made_and_said_what_it_is(walks, tmp_path, capsys):
    out = tmp_path / "walk.gif"
    arguments = ["render", str(walks), "walk", "0", "2", "--out", str(out), "--size", "200x80", "--fps", "10"]
    assert main(arguments) == 0
    assert "10 pictures of 200x80, 1.0 s at 10 a second" in capsys.readouterr().out
    with Image.open(out) as video:
        assert (video.size, video.n_frames) == ((200, 80), 10)
    assert "--overwrite" in failing(capsys, *arguments[1:])
    assert main([*arguments, "--overwrite", "--end", "0.5", "--no-reference"]) == 0
    with Image.open(out) as video:
        assert video.n_frames == 6


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("wolf", "--out", "a.mp4"), "no motion 'wolf'; it has: stroll, walk"),
        (("walk", "3", "--out", "a.mp4"), "no trajectory 3; it has trajectories 0 to 2"),
        (("walk", "0", "9", "--out", "a.mp4"), "no trajectory 9"),
        (("walk", "--out", "a.avi"), "videos end in .mp4 or .gif, not '.avi'"),
        (("walk", "--out", "a"), "videos end in"),
        (("walk", "--out", "nowhere/a.mp4"), "nowhere: no such folder"),
        (("walk", "--out", "folder.mp4"), "is a folder"),
        (("walk", "--out", "a.mp4", "--size", "big"), "such as 640x480, not 'big'"),
        (("walk", "--out", "a.mp4", "--size", "641x480"), "width must be an even number"),
        (("walk", "--out", "a.mp4", "--size", "9000x480"), "width must be an even number from 64 to 4096"),
        (("walk", "--out", "a.mp4", "--fps", "0"), "fps must be between 1 and 240"),
        (("walk", "--out", "a.mp4", "--fps", "nan"), "--fps: 'nan' is not finite"),
        (("walk", "--out", "a.mp4", "--start", "5"), "the trajectories end at 0.983 s"),
        (("walk", "--out", "a.mp4", "--start", "0.5", "--end", "0.2"), "not 0.5 to 0.2"),
        (("walk", "--out", "a.mp4", "--columns", "0"), "at least one column"),
        (("walk", *["0"] * 20, "--columns", "20", "--out", "a.mp4"), "20 columns leave 32x480 pixels for each"),
    ],
)
def test_wrong_input_gets_one_line_and_leaves_nothing(walks, tmp_path, monkeypatch, capsys, arguments, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.mp4").mkdir()
    assert message in failing(capsys, walks, *arguments)
    assert [one.name for one in tmp_path.iterdir()] == ["folder.mp4"]


def test_what_is_no_dataset_gets_one_line(tmp_path, capsys):
    assert "no dataset here" in failing(capsys, tmp_path / "nothing.zarr", "walk", "--out", tmp_path / "a.mp4")


def test_poses_that_are_not_finite_are_named(walks, tmp_path, capsys):
    copy = shutil.copytree(walks, tmp_path / "spoilt.zarr")
    array = zarr.open_group(copy / "walk", mode="a", use_consolidated=False)["joint_position"]
    array[1, 7, 3] = np.nan
    assert "joint_position of trajectory 1 is not finite" in failing(
        capsys, copy, "walk", "1", "--out", tmp_path / "a.mp4"
    )
    assert not (tmp_path / "a.mp4").exists()


def test_sizes_are_read():
    assert parsed_size("640x480") == parsed_size("640X480") == (640, 480)
