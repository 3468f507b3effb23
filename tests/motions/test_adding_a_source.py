"""The worked example of docs/adding-a-source.md, run as it stands there."""

import re

import numpy as np
import pytest

from kine2go_warp.errors import ClipError
from kine2go_warp.motions import sources
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.motions.generator import DogGait, generate
from kine2go_warp.motions.keypoints import KEYPOINTS
from kine2go_warp.motions.quality import assess, clip_faults
from kine2go_warp.motions.retarget import retarget
from kine2go_warp.motions.sources.ai4animation import COLUMN_OF_KEYPOINT
from kine2go_warp.robots import GO2
from tests.conftest import REPOSITORY
from tests.motions.test_retarget import entry_of


@pytest.fixture
def cat_capture(monkeypatch):
    page = (REPOSITORY / "docs" / "adding-a-source.md").read_text()
    namespace = {}
    exec(re.search(r"```python\n(.*?)```", page, re.DOTALL).group(1), namespace)
    monkeypatch.setitem(sources.SOURCES, "cat_capture", namespace["CatCapture"])
    return namespace["CatCapture"]


def write_cat(path):
    """The generated dog at half its size, in centimetres and y up."""
    points = 0.5 * generate(DogGait(), 121).points
    x, y, z = np.moveaxis(points, -1, 0)
    y_up = 100.0 * np.stack([x, z, -y], axis=-1)
    np.savez(path, rate=60.0, **{name: y_up[:, COLUMN_OF_KEYPOINT[name]] for name in KEYPOINTS})


def test_the_example_makes_a_clean_clip(cat_capture, solver, tmp_path):
    assert cat_capture.name == "cat_capture"
    write_cat(tmp_path / "cat.npz")
    entry = entry_of("cat.npz", 30, 60, "cat_capture")
    result = retarget(entry, tmp_path, solver, RetargetConfig())
    assert clip_faults(assess(result, GO2)) == []
    assert result.clip.origin.source == "cat_capture"


def test_the_example_refuses_what_is_not_a_cat(cat_capture, tmp_path):
    (tmp_path / "dog.npz").write_text("woof")
    with pytest.raises(ClipError, match="not a cat"):
        cat_capture().read(tmp_path / "dog.npz")
