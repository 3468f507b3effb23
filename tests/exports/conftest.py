"""A small dataset of two motions of one licence."""

import shutil

import numpy as np
import pytest

from kine2go_warp.dataset.trajectories import Trajectories
from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.robots import GO2
from tests.dataset.test_store import SIMULATION, made_up

ORIGINS = {
    "one": {"source": "ai4animation", "licence": "CC BY-NC 4.0", "citation": "Zhang et al., 2018", "rejected": {}},
    "two": {"source": "vhdc", "licence": "CC BY-NC 4.0", "citation": "Horses, 2020", "rejected": {"distance": 2}},
}

LENGTHS = (20, 15, 20)
"""Valid rows of the trajectories of each motion."""


@pytest.fixture(scope="session")
def written() -> dict[str, Trajectories]:
    """What the dataset was made of."""
    rng = np.random.default_rng(0)
    return {name: made_up(rng) for name in ORIGINS}


@pytest.fixture(scope="session")
def pristine(written, tmp_path_factory):
    """The dataset, not to be changed."""
    path = tmp_path_factory.mktemp("pristine") / "dataset.zarr"
    for name, data in written.items():
        assert tuple(data.draws["length"]) == LENGTHS
        DatasetWriter(path, GO2).write(name, data, SIMULATION, {"motion": name, **ORIGINS[name]})
    return path


@pytest.fixture
def store(pristine, tmp_path):
    """A copy of the dataset."""
    return shutil.copytree(pristine, tmp_path / pristine.name)


def valid_rows(written: dict[str, Trajectories], array: str) -> np.ndarray:
    """An array of all trajectories one after the other, shape [num_rows, num_columns]."""
    parts = [
        data.rows[array][index, :length].reshape(length, -1)
        for data in written.values()
        for index, length in enumerate(LENGTHS)
    ]
    return np.concatenate(parts)
