"""Trajectories that are ready to be drawn."""

import pytest

from kine2go_warp.dataset import open_dataset
from kine2go_warp.renders.video import read_trajectories


@pytest.fixture(scope="session")
def trajectories(walks):
    return read_trajectories(open_dataset(walks).motion("walk"), [0, 1, 2])
