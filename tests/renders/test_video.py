"""Pictures show the recorded poses, and videos read back as what they should be."""

import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import av
import numpy as np
import pytest
from PIL import Image

from kine2go_warp.errors import RenderError
from kine2go_warp.renders import process as process_module
from kine2go_warp.renders.captions import caption
from kine2go_warp.renders.encoding import possible_rate
from kine2go_warp.renders.process import RenderProcess
from kine2go_warp.renders.video import RenderConfig, is_level, render_video, video_instants, video_pictures

pytestmark = pytest.mark.usefixtures("can_draw")

SIZE = (320, 240)
SMALL = RenderConfig(*SIZE)


@pytest.fixture(scope="module")
def renderer(request):
    request.getfixturevalue("can_draw")
    with RenderProcess(*SIZE) as one:
        yield one


def dark(picture):
    """Where the robot's dark parts are: legs and head."""
    return picture.astype(int).sum(axis=-1) < 180


def green(picture):
    """Where the reference is."""
    red, other, blue = np.moveaxis(picture.astype(int), -1, 0)
    return (other > red + 25) & (other > blue + 5)


def read_video(path):
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(stream)], stream.average_rate


def test_a_picture_has_the_size_asked_for_and_shows_something(renderer, trajectories):
    picture = renderer.draw(trajectories[0].request(0))
    assert picture.shape == (240, 320, 3)
    assert dark(picture).sum() > 300
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 100


def test_other_rows_give_other_pictures_and_the_same_row_the_same(renderer, trajectories):
    first, again = renderer.draw(trajectories[0].request(10)), renderer.draw(trajectories[0].request(10))
    assert not np.array_equal(first, renderer.draw(trajectories[0].request(20)))
    np.testing.assert_array_equal(first, again)
    with RenderProcess(*SIZE) as other:
        np.testing.assert_array_equal(first, other.draw(trajectories[0].request(10)))


def test_the_robot_stays_in_the_middle_whether_it_goes_straight_turns_or_speeds_up(renderer, trajectories):
    for trajectory in trajectories:
        for row in (0, len(trajectory.time) // 2, len(trajectory.time) - 1):
            y, x = np.nonzero(dark(renderer.draw(trajectory.request(row, False))))
            assert abs(x.mean() / 320 - 0.5) < 0.12
            assert abs(y.mean() / 240 - 0.5) < 0.12
            assert min(x.min(), y.min(), 319 - x.max(), 239 - y.max()) > 0, "no part of it is cut off"


def test_the_reference_is_green_and_can_be_left_out(renderer, trajectories):
    assert green(renderer.draw(trajectories[0].request(0))).sum() > 300
    assert not green(renderer.draw(trajectories[0].request(0, False))).any()


def test_the_reference_is_where_it_was_recorded(renderer, trajectories):
    """0.1 m back, seen at 125 degrees from 1.5 m: 18 pixels to the left, of the 220 that a metre has there."""
    rows = trajectories[0].rows
    middles = []
    for reference in (rows["root_position"], rows["reference_root_position"]):
        away = {"root_position": rows["root_position"] + np.float32([0.0, 0.0, 50.0])}
        alone = replace(trajectories[0], rows={**rows, **away, "reference_root_position": reference})
        middles.append(np.nonzero(green(renderer.draw(alone.request(30))))[1].mean())
    assert middles[0] - middles[1] == pytest.approx(18.0, abs=2.0)


def test_ground_that_is_not_level_is_left_out(renderer, trajectories):
    level, other = (
        renderer.draw(trajectories[0].request(0)),
        renderer.draw(replace(trajectories[0], level=False).request(0)),
    )
    assert not np.array_equal(other[-1], level[-1])
    assert dark(other).sum() > 300
    waves = {"training_settings": {"env": {"terrain": {"kind": "waves"}}}}
    assert not is_level(waves)
    assert is_level({})
    assert is_level({"training_settings": {"env": {"terrain": {"kind": "flat"}}}})


def test_an_mp4_reads_back(walks, tmp_path):
    path = tmp_path / "walk.mp4"
    counts = []
    record = render_video(walks, "walk", [0], path, SMALL, lambda done, total: counts.append((done, total)))
    pictures, rate = read_video(path)
    assert len(pictures) == record.pictures == 30
    assert rate == Fraction(30)
    assert counts == [(done, 30) for done in range(1, 31)]
    assert {picture.shape for picture in pictures} == {(240, 320, 3)}
    assert all(dark(picture).sum() > 200 for picture in pictures)
    assert all(np.abs(one.astype(int) - other).max() > 60 for one, other in pairwise(pictures))
    assert [one.name for one in tmp_path.iterdir()] == ["walk.mp4"]


def test_a_gif_reads_back_and_runs_at_the_speed_of_the_robot(walks, tmp_path):
    path = tmp_path / "walk.gif"
    record = render_video(walks, "walk", [2], path, SMALL)
    with Image.open(path) as video:
        assert video.size == SIZE
        assert video.n_frames == record.pictures
        durations = []
        for number in range(video.n_frames):
            video.seek(number)
            durations.append(video.info["duration"])
    assert durations == [30] * record.pictures
    assert record.pictures * 0.030 == pytest.approx(1.0, abs=0.05)


def test_the_same_input_gives_the_same_video(walks, tmp_path):
    config = RenderConfig(*SIZE, end=0.2)
    for name in ("a", "b"):
        render_video(walks, "walk", [1], tmp_path / f"{name}.mp4", config)
        render_video(walks, "walk", [1], tmp_path / f"{name}.gif", config)
    for ending in ("gif", "mp4"):
        assert (tmp_path / f"a.{ending}").read_bytes() == (tmp_path / f"b.{ending}").read_bytes()


def test_videos_of_any_rate_last_as_long_as_what_they_show(trajectories):
    for fps in (10.0, 25.0, 30.0, 60.0, 120.0):
        instants = video_instants(trajectories, RenderConfig(fps=fps), fps)
        assert instants[0] == 0.0
        assert trajectories[0].time[-1] - instants[-1] < 1.0 / fps + 1e-9
    assert [trajectories[0].row_at(instant) for instant in video_instants(trajectories, SMALL, 30.0)] == list(
        range(0, 60, 2)
    )
    cut = video_instants(trajectories, RenderConfig(start=0.2, end=0.5), 30.0)
    np.testing.assert_allclose(cut[[0, -1]], [0.2, 0.5])


def test_rates_of_gifs_are_whole_hundredths_of_a_second(tmp_path):
    assert [possible_rate(tmp_path / "a.gif", rate) for rate in (10.0, 25.0, 60.0, 240.0)] == [10.0, 25.0, 50.0, 50.0]
    assert possible_rate(tmp_path / "a.mp4", 29.97) == 29.97


def test_a_grid_shows_each_trajectory_in_its_place(trajectories):
    alone = next(video_pictures(trajectories[:1], np.array([0.0]), RenderConfig(160, 120)))
    grid = next(video_pictures(trajectories, np.array([0.0]), SMALL))
    np.testing.assert_array_equal(grid[:120, :160], alone)
    assert dark(grid[:120, 160:]).sum() > 100
    assert dark(grid[120:, :160]).sum() > 100
    assert grid[120:, 160:].std() == 0.0, "three of four places are taken"
    row = next(video_pictures(trajectories, np.array([0.0]), RenderConfig(480, 120, columns=3)))
    np.testing.assert_array_equal(row[:, :160], alone)


def test_a_short_trajectory_stands_still_at_its_end_and_says_so(trajectories):
    before, at_end, beyond = video_pictures(trajectories[1:2], np.array([0.5, 54 / 60, 59 / 60]), SMALL)
    middle = slice(40, 200)
    np.testing.assert_array_equal(at_end[middle], beyond[middle])
    assert not np.array_equal(before[middle], at_end[middle])
    assert not np.array_equal(at_end[200:], beyond[200:])


def test_texts_are_burnt_in_and_fit(trajectories):
    blank = np.full((240, 320, 3), 128, np.uint8)
    first, second = caption(blank, ("walk  #0", "row 5  0.083 s")), caption(blank, ("walk  #0", "row 6  0.100 s"))
    np.testing.assert_array_equal(first[:120], second[:120])
    assert not np.array_equal(first[120:], second[120:])
    long = caption(blank, ("a_motion_with_a_name_that_is_much_too_long_for_it", "row 0"))
    assert (long[:, -1] == 128).all()
    shown = next(video_pictures(trajectories[:1], np.array([0.0]), SMALL))
    assert dark(shown[225:, :100]).any(), "ink at the lower left"


def test_an_interrupted_video_leaves_nothing(walks, tmp_path):
    def interrupt(*_):
        raise KeyboardInterrupt

    for name in ("a.mp4", "a.gif"):
        with pytest.raises(KeyboardInterrupt):
            render_video(walks, "walk", [0], tmp_path / name, SMALL, interrupt)
    assert list(tmp_path.iterdir()) == []


def test_without_a_library_the_error_names_what_to_install(monkeypatch):
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(process_module.ctypes.util, "find_library", lambda _: None)
    with pytest.raises(RenderError, match=r"no OpenGL library .*libegl1"):
        RenderProcess(*SIZE)
    monkeypatch.setenv("MUJOCO_GL", "glfw")
    with pytest.raises(RenderError, match="set it to egl or osmesa"):
        RenderProcess(*SIZE)


def test_a_driver_that_fails_ends_in_one_error(trajectories):
    with RenderProcess(*SIZE) as one:
        one._process.kill()
        with pytest.raises(RenderError, match="the process that draws has ended"):
            one.draw(trajectories[0].request(0))
    assert one._process.poll() is not None


def test_drawing_leaves_torch_in_peace(tmp_path):
    """Mesa's LLVM and Triton's in one process crash it."""
    script = """
import torch
from kine2go_warp.renders.process import RenderProcess
with RenderProcess(64, 64):
    pass
import tensordict
"""
    result = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
