"""Trajectories that are ready to be drawn."""

import pytest

from kine2go_warp.dataset import open_dataset
from kine2go_warp.renders.film import read_takes


@pytest.fixture(scope="session")
def takes(walks):
    return read_takes(open_dataset(walks).motion("walk"), [0, 1, 2])
