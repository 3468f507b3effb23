"""``kine2go policy train --rerun``: the live view of a training."""

import pytest

from kine2go_warp.cli.main import main
from tests.recordings.conftest import Recorded

TINY = ["--device", "cpu", "--iterations", "2", "--num-worlds", "8", "--processes", "1"]


@pytest.fixture
def clip_file(clip, tmp_path):
    clip.save(tmp_path / "trot.npz")
    return str(tmp_path / "trot.npz")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--rerun"], "no display to open the viewer on; use --rerun-web"),
        (["--rerun-web", "--rerun-save", "a.rrd"], "choose one of --rerun, --rerun-web and --rerun-save"),
        (["--rerun-save", "a.mp4"], "name a file that ends in .rrd"),
    ],
)
def test_what_cannot_be_watched_is_said_before_anything_is_trained(
    clip_file, tmp_path, monkeypatch, capsys, options, message
):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.chdir(tmp_path)
    assert main(["train", clip_file, "--out", "policy", *TINY, *options]) == 2
    assert message in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["trot.npz"]


def test_a_training_is_written_to_a_file(clip_file, tmp_path, capsys):
    target = tmp_path / "watched.rrd"
    options = ["--out", str(tmp_path / "policy"), *TINY, "--rerun-save", str(target)]
    assert main(["train", clip_file, *options]) == 0
    assert f"{target}: " in capsys.readouterr().out
    entities = Recorded(target).entities
    assert {f"/worlds/{world}/reference/base" for world in range(4)} < entities
    assert {"/curves/reward", "/curves/error", "/curves/speed"} < entities
    assert main(["train", clip_file, *options]) == 2, "the recording is not replaced"
