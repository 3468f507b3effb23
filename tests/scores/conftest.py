"""A small simulated motion, and trajectories of noise whose second one is short."""

import numpy as np
import pytest

from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.robots import GO2
from kine2go_warp.rollouts.config import GatherConfig
from kine2go_warp.rollouts.gather import gather
from tests.conftest import ANYTHING_GOES


@pytest.fixture(scope="session")
def simulated_dataset(policy, tmp_path_factory):
    """A dataset of a policy that is not good."""
    path = tmp_path_factory.mktemp("scores") / "dataset.zarr"
    loose = GatherConfig(trajectories=4, rows=60, **ANYTHING_GOES)
    assert gather(policy, DatasetWriter(path, GO2), loose, "cpu").accepted == 4
    return path


@pytest.fixture(scope="session")
def simulated(simulated_dataset):
    return open_dataset(simulated_dataset, include_rejected=True).load("dog_trot")


LENGTHS = np.array([12, 7, 12])
"""Rows of the trajectories of noise."""


@pytest.fixture
def noise(rng):
    """Makes arrays of noise for three trajectories, NaN beyond the end of the second."""

    def make(*shape):
        values = rng.normal(size=(3, 12, *shape))
        values[1, 7:] = np.nan
        return values

    return make


@pytest.fixture
def orientations(noise):
    """Makes random unit quaternions for three trajectories."""

    def make():
        values = noise(4)
        return values / np.linalg.norm(values, axis=-1, keepdims=True)

    return make
