"""Every fault is found, by the check that is made for it and in the array that has it, and nothing else is blamed."""

import numpy as np
import pytest

from kine2go_warp.dataset.checks.block import Block
from kine2go_warp.dataset.checks.catalogue import ROW_CHECKS, all_checks
from kine2go_warp.dataset.checks.reading import StoredMotion, blocks
from kine2go_warp.dataset.checks.run import check_dataset
from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.robots import GO2
from kine2go_warp.rollouts.config import GatherConfig
from kine2go_warp.rollouts.gather import gather
from tests.conftest import ANYTHING_GOES
from tests.dataset.checks.physics_faults import PHYSICS_FAULTS
from tests.dataset.checks.row_faults import ROW_FAULTS
from tests.dataset.checks.store_faults import STORE_FAULTS


def slug(name):
    return name.replace(" ", "-")


def errors(report):
    return [finding for finding in report.findings if not finding.is_remark]


def reads(check):
    """The arrays that a check of rows reads."""
    return {name for one in ROW_CHECKS if one.name == check for name in one.needs}


def test_a_simulated_dataset_is_clean_and_no_check_is_left_out(clean_dataset):
    report = check_dataset(clean_dataset, GO2, physics=True)
    assert report.findings == ()
    assert {result.state for result in report.results} == {"ok"}


def test_a_dataset_without_noise_is_clean(policy, tmp_path):
    quiet = GatherConfig(trajectories=2, rows=60, action_noise_scale=(0.0, 0.0), **ANYTHING_GOES)
    gather(policy, DatasetWriter(tmp_path / "quiet.zarr", GO2), quiet, "cpu")
    assert check_dataset(tmp_path / "quiet.zarr", GO2).findings == ()


def test_every_check_finds_a_fault_of_its_own():
    shown = {fault.check for fault in (*STORE_FAULTS.values(), *ROW_FAULTS.values())}
    assert shown | {"physics"} == {check.name for check in all_checks()}


# Writing labels anew through zarr itself makes it warn about their text type.
@pytest.mark.filterwarnings("ignore::zarr.errors.UnstableSpecificationWarning")
@pytest.mark.parametrize("name", STORE_FAULTS, ids=slug)
def test_a_fault_of_the_store_is_found(name, dataset_copy):
    fault = STORE_FAULTS[name]
    fault.spoil(dataset_copy)
    found = errors(check_dataset(dataset_copy, GO2))
    lines = [str(one) for one in found]
    assert (fault.check, fault.array) in {(one.check, one.array) for one in found}, lines
    assert {one.check for one in found} <= {fault.check, *fault.others}, lines


@pytest.mark.parametrize("name", ROW_FAULTS, ids=slug)
def test_a_fault_of_the_rows_is_found_in_its_trajectory_and_array(name, dataset_copy):
    fault = ROW_FAULTS[name]
    fault.spoil(dataset_copy)
    report = check_dataset(dataset_copy, GO2)
    found = errors(report)
    lines = [str(one) for one in found]
    assert (fault.check, fault.array) in {(one.check, one.array) for one in found}, lines
    for one in found:
        assert one.trajectory in (*fault.trajectories, None), lines
        assert one.array in fault.touches or reads(one.check) & set(fault.touches), lines
    assert fault.diagnosis in " ".join(map(str, report.diagnoses)), report.diagnoses


@pytest.mark.parametrize("name", PHYSICS_FAULTS, ids=slug)
def test_a_fault_of_the_mechanics_is_found_by_steps_of_plain_mujoco(name, dataset_copy):
    spoil, array = PHYSICS_FAULTS[name]
    spoil(dataset_copy)
    report = check_dataset(dataset_copy, GO2, physics=True)
    found = {one.array for one in errors(report) if one.check == "physics"}
    assert array in found, [str(one) for one in errors(report)]


def test_a_few_impacts_do_not_condemn_velocities_that_hardly_change(clean_dataset):
    """Rows of a joint that turns evenly but for impacts, which change its speed within a row and back again."""
    time = np.arange(400) / 60.0
    velocity = np.tile((0.5 + 0.02 * np.sin(3.0 * time))[None, :, None], (1, 1, 12))
    change = np.concatenate([[0.0], (0.375 * velocity[0, :-1, 0] + 0.625 * velocity[0, 1:, 0]) / 60.0])
    change[::40] += 0.0005
    position = np.tile(np.cumsum(change)[None, :, None], (1, 1, 12))
    root = {"control_frequency": 60.0, "physics_substeps": 4}
    block = next(blocks(StoredMotion.open(clean_dataset / "dog_trot"), root, GO2))
    rows = {"joint_position": position, "joint_velocity": velocity}
    made = Block(0, rows, block.settings, GO2)
    check = next(one for one in ROW_CHECKS if one.name == "joint velocity, overall")
    assert check.off_by(made).max() < check.tolerance
