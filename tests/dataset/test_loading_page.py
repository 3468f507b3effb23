"""The examples of docs/loading.md, run one after the other."""

import re

import numpy as np

from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.robots import GO2
from tests.conftest import REPOSITORY
from tests.dataset.test_store import SIMULATION, made_up


def test_the_examples_of_the_page_work(tmp_path, rng, monkeypatch):
    (tmp_path / "runs" / "demo").mkdir(parents=True)
    DatasetWriter(tmp_path / "runs/demo/dataset.zarr", GO2).write(
        "dog_trot", made_up(rng, rows=571), SIMULATION, {"rejected": {}, "policy_std": [0.3] * 12}
    )
    page = (REPOSITORY / "docs" / "loading.md").read_text()
    blocks = [block for block in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "lerobot" not in block]
    assert len(blocks) == 9
    monkeypatch.chdir(tmp_path)
    names = {}
    for block in blocks:
        exec(block, names)
    assert names["knee"].shape == (571,)
    assert names["states"].shape == names["actions"].shape == (256, 32, 12)
    assert names["log_probability"].shape == (571,)
    assert not names["fallen"].references
    assert np.isfinite(names["normal"]).all()
