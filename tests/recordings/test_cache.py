import json

import pytest

from kine2go_warp.dataset.motion import Motion
from kine2go_warp.dataset.reviews import ACCEPTED, add_reviews, new_review
from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.errors import RecordingError
from kine2go_warp.recordings.cache import RecordingCache
from kine2go_warp.recordings.motion import Style
from kine2go_warp.robots import GO2
from tests.dataset.test_store import SIMULATION, made_up


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "recordings"


def test_a_recording_is_written_once(motion, folder):
    cache = RecordingCache(folder, Style())
    first, second = cache.ensure(motion), cache.ensure(motion)
    assert (first.is_new, second.is_new) == (True, False)
    assert (first.shown, second.shown) == (3, 3)
    assert sorted(path.name for path in folder.iterdir()) == ["made_up.json", "made_up.rrd"]


def test_it_is_written_again_when_the_data_change(motion, folder, rng):
    cache = RecordingCache(folder, Style())
    cache.ensure(motion)
    DatasetWriter(motion.path, GO2).write("made_up", made_up(rng), SIMULATION, motion.attributes)
    assert cache.ensure(Motion(motion.path, "made_up")).is_new


def test_it_is_written_again_when_a_verdict_is_given_since_it_shows_it(motion, folder):
    cache = RecordingCache(folder, Style())
    cache.ensure(motion)
    (one,) = motion.read(motion.references()[:1], None)
    add_reviews(motion.path, [new_review(one, ACCEPTED, "")])
    assert cache.ensure(motion).is_new


def test_a_recording_with_more_trajectories_than_wanted_is_enough(motion, folder):
    assert RecordingCache(folder, Style(trajectories=2)).ensure(motion).shown == 2
    assert not RecordingCache(folder, Style(trajectories=1)).ensure(motion).is_new
    everything = RecordingCache(folder, Style()).ensure(motion)
    assert (everything.is_new, everything.shown) == (True, 3)
    assert not RecordingCache(folder, Style(trajectories=2)).ensure(motion).is_new


def test_a_file_that_has_changed_since_is_written_again(motion, folder):
    cache = RecordingCache(folder, Style())
    path = cache.ensure(motion).path
    path.write_bytes(path.read_bytes()[:-1] + b"!")
    assert cache.ensure(motion).is_new
    assert not cache.ensure(motion).is_new


def test_a_recording_of_another_version_of_rerun_is_written_again(motion, folder, monkeypatch):
    """Case 17-recording-of-another-rerun."""
    cache = RecordingCache(folder, Style())
    cache.ensure(motion)
    monkeypatch.setattr("rerun.__version__", "0.22.0")
    assert cache.ensure(motion).is_new


@pytest.mark.parametrize("note", ["", "[]", "{}", '{"content": 3, "shown": "x"}'])
def test_a_note_that_cannot_be_read_counts_as_another(motion, folder, note):
    cache = RecordingCache(folder, Style())
    cache.ensure(motion)
    (folder / "made_up.json").write_text(note)
    assert cache.ensure(motion).is_new
    assert json.loads((folder / "made_up.json").read_text())["shown"] == 3


def test_a_file_that_is_no_recording_of_a_dataset_is_kept(motion, folder):
    folder.mkdir()
    (folder / "made_up.rrd").write_text("precious")
    with pytest.raises(RecordingError, match="--overwrite"):
        RecordingCache(folder, Style()).ensure(motion)
    assert (folder / "made_up.rrd").read_text() == "precious"
    assert RecordingCache(folder, Style(), overwrite=True).ensure(motion).is_new


def test_a_file_in_place_of_the_folder_is_refused(folder):
    folder.write_text("precious")
    with pytest.raises(RecordingError, match="is a file"):
        RecordingCache(folder, Style())
