"""Stored observations are what the policy saw: independent code computes the same from the rows."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray

from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.checks.run import check_dataset
from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.deployment.controller import ExportedPolicy, PolicyController
from kine2go_warp.deployment.observer import MeasuredState, ObservationBuilder
from kine2go_warp.deployment.reference import PlacedClip
from kine2go_warp.robots import GO2
from kine2go_warp.rollouts.config import GatherConfig
from kine2go_warp.rollouts.gather import gather
from tests.conftest import ANYTHING_GOES

STATE = ("root_position", "root_orientation", "root_linear_velocity", "root_angular_velocity", "joint_position",
         "joint_velocity")  # fmt: skip


@pytest.fixture(scope="module")
def observed(policy, tmp_path_factory):
    path = tmp_path_factory.mktemp("observed") / "dataset.zarr"
    config = GatherConfig(trajectories=3, rows=40, observations=True, **ANYTHING_GOES)
    gather(policy, DatasetWriter(path, GO2), config, "cpu")
    return path


def test_the_deployments_own_code_computes_them_from_the_rows(observed, exported):
    policy = ExportedPolicy.load(exported)
    metadata = policy.metadata
    compared = 0
    for one in open_dataset(observed).trajectories():
        reference = PlacedClip(policy.clips[0], metadata.control_rate)
        reference.place(float(one.values["start_phase"]), (0.0, 0.0), float(one.values["heading"]))
        builder = ObservationBuilder(metadata, reference)
        began = int(one.values["initial_state/reference_step"])
        output = np.zeros(12)
        for row in range(one.length):
            state = MeasuredState(**{name: one.arrays[name][row].astype(float) for name in STATE})
            found = builder.observe(state, output, began + row)
            if row >= 4:
                # Earlier rows look back to states and outputs from before the first row.
                np.testing.assert_allclose(found, one.arrays["observation"][row], atol=1e-4, err_msg=f"row {row}")
                compared += 1
            control = SimpleNamespace(metadata=metadata, reference=reference, step=began + row)
            middle, wider = (PolicyController.joint_target(control, np.full(12, out)) for out in (0.0, 1.0))  # pyright: ignore
            output = (one.arrays["joint_target"][row] - middle) / (wider - middle)
    assert compared == 3 * 36


def test_each_number_has_a_name_and_a_unit(observed):
    data = xarray.open_zarr(observed, group="dog_trot")
    knee = data["observation"].sel(observed="joint_position[t].FL_calf_joint")
    pose = GO2.default_joint_position[GO2.joint_names.index("FL_calf_joint")]
    np.testing.assert_allclose(knee, data["joint_position"].sel(joint="FL_calf_joint") - pose, atol=1e-6)
    terms = open_dataset(observed).motion("dog_trot").attributes["observation_terms"]
    assert [name for term in terms for name in term["columns"]] == data["observed"].values.tolist()
    assert {term["name"]: term["unit"] for term in terms}["joint_velocity[t]"] == "rad/s"


def test_a_dataset_with_observations_is_clean(observed):
    assert check_dataset(observed, GO2).findings == ()
