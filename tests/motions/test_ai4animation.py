import numpy as np
import pytest

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.generator import DogGait, generate, write_ai4animation
from kine2go_warp.motions.keypoints import FrameRange
from kine2go_warp.motions.sources import AI4Animation, source_named
from kine2go_warp.motions.sources.ai4animation import COLUMN_OF_KEYPOINT


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "dog.txt"
    write_ai4animation(generate(DogGait(turn_rate=0.5), 40).points, path)
    return path


def test_what_the_generator_writes_comes_back(file):
    motion = AI4Animation().read(file)
    points = generate(DogGait(turn_rate=0.5), 40).points
    assert motion.rate == pytest.approx(60.0)
    for name, column in COLUMN_OF_KEYPOINT.items():
        np.testing.assert_allclose(motion.point(name), points[:, column], atol=5.1e-6)


def change_line(text, number, line):
    lines = text.splitlines()
    lines[number] = line(lines[number])
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda text: text[:0], "0 line"),
        (lambda text: text.splitlines()[0] + "\n", "1 line"),
        (lambda text: change_line(text, 6, lambda line: line[: len(line) // 2]), "line 7: .* columns instead of 81"),
        (lambda text: change_line(text, 2, lambda line: line + ",\t1.0"), "line 3: 82 columns"),
        (lambda text: change_line(text, 4, lambda line: line.replace(line.split(",")[0], "nan", 1)), "line 5"),
        (lambda text: change_line(text, 4, lambda line: line.replace(line.split(",")[0], "12a", 1)), "line 5: not a"),
        (lambda text: change_line(text, 9, lambda line: line.replace(line.split(",")[0], "1e9", 1)), "line 10"),
        (lambda text: text.replace("\n", "\n\n", 1), "line 2: 1 columns"),
    ],
    ids=["empty", "one frame", "truncated", "too wide", "nan", "word", "not metres", "gap"],
)
def test_a_malformed_file_is_refused_with_its_line(file, damage, message):
    file.write_text(damage(file.read_text()))
    with pytest.raises(ClipError, match=message) as error:
        AI4Animation().read(file)
    assert str(file) in str(error.value)


def test_what_is_not_a_text_file_is_refused(tmp_path):
    with pytest.raises(ClipError, match="no such"):
        AI4Animation().read(tmp_path / "missing.txt")
    with pytest.raises(ClipError, match="folder"):
        AI4Animation().read(tmp_path)
    (tmp_path / "binary.txt").write_bytes(b"\xff\xfe\x00\x01" * 100)
    with pytest.raises(ClipError, match="not a text file"):
        AI4Animation().read(tmp_path / "binary.txt")


@pytest.mark.parametrize(
    ("frames", "expected"),
    [(FrameRange(0, -1), (0, 40)), (FrameRange(5, 20), (5, 20)), (FrameRange(0, 40), (0, 40))],
)
def test_a_range_is_a_slice_and_minus_one_includes_the_last_frame(frames, expected):
    assert frames.resolve(40, "clip") == expected


@pytest.mark.parametrize("frames", [(-2, 10), (10, 10), (20, 10), (0, 41), (38, -1), (5, 6)])
def test_a_range_outside_the_clip_or_too_short_is_refused(frames):
    with pytest.raises(ClipError, match="clip: "):
        FrameRange(*frames).resolve(40, "clip")


def test_an_unknown_source_is_named():
    with pytest.raises(Exception, match="unknown motion source 'cat'; known are: ai4animation"):
        source_named("cat")


def test_a_file_is_read_once_until_it_is_written_again(file, monkeypatch):
    reads, read = [], AI4Animation.read
    monkeypatch.setattr(AI4Animation, "read", lambda self, path: reads.append(path) or read(self, path))
    first = source_named("ai4animation").load(file)
    assert source_named("ai4animation").load(file) is first
    write_ai4animation(generate(DogGait(turn_rate=0.5), 50).points, file)
    assert [source_named("ai4animation").load(file).num_frames, len(reads)] == [50, 2]
