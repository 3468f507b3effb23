"""A motion with made-up rows in a real store, and a reader of recordings."""

import numpy as np
import pytest

from kine2go_warp.dataset.motion import Motion
from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.robots import GO2
from tests.dataset.test_store import SIMULATION, made_up

RrdReader = pytest.importorskip("rerun.chunk").RrdReader

LIMITS = {"max_distance": 4.0, "max_angle": 3.2, "max_joint_rmse": 3.0}


@pytest.fixture
def motion(tmp_path, rng):
    """Three trajectories of 20, 15 and 20 rows."""
    attributes = {"rejected": {}, "gather_settings": LIMITS}
    DatasetWriter(tmp_path / "dataset.zarr", GO2).write("made_up", made_up(rng), SIMULATION, attributes)
    return Motion(tmp_path / "dataset.zarr", "made_up")


class Recorded:
    """What a recording holds, by entity and component."""

    def __init__(self, path):
        self.chunks = list(RrdReader(path).stream())
        self.entities = {chunk.entity_path for chunk in self.chunks}

    def column(self, entity, component):
        """Return time [s] and values of what changes, a list of instances a row."""
        (chunk,) = [one for one in self.chunks if one.entity_path == entity and not one.is_static]
        batch = chunk.to_record_batch()
        time = batch.column("time").to_numpy().astype(np.int64) * 1e-9
        return time, batch.column(component).to_pylist()

    def fixed(self, entity, component):
        """Return the instances of what does not change."""
        for chunk in self.chunks:
            batch = chunk.to_record_batch()
            if chunk.entity_path == entity and chunk.is_static and component in batch.schema.names:
                return batch.column(component).to_pylist()[0]
        raise KeyError((entity, component))
