"""The examples of docs/python.md, run one after the other, with fewer worlds, iterations and rollouts."""

import re

import numpy as np

from tests.conftest import ANYTHING_GOES, REPOSITORY

SMALLER = {
    "k2g.presets.FAST)": 'k2g.presets.FAST.override({"env.num_worlds": 8, "ppo.iterations": 1}), device="cpu")',
    "trajectories=20)": 'trajectories=2, rows=40, device="cpu", **ANYTHING_GOES)',
    "num_worlds=256)": 'num_worlds=8, device="cpu")',
    "worlds=16, seconds=5.0)": 'worlds=2, seconds=0.5, device="cpu")',
}


def test_the_examples_of_the_page_work(tmp_path, monkeypatch):
    page = (REPOSITORY / "docs" / "python.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert len(blocks) == 8
    for shown, run in SMALLER.items():
        assert sum(shown in block for block in blocks) == 1, shown
        blocks = [block.replace(shown, run) for block in blocks]
    monkeypatch.chdir(tmp_path)
    names = {"ANYTHING_GOES": ANYTHING_GOES}
    for block in blocks:
        exec(block, names)
    assert len(names["data"].motion("dog_trot").references()) == 2
    assert names["preset"].env.motor.stiffness == 50.0
    assert names["rewards"].shape == (8,)
    assert names["observations"].shape[0] == 8
    assert np.isfinite(names["observations"]).all()
