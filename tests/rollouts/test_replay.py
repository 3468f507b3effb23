import shutil
from dataclasses import replace

import numpy as np
import pytest
import zarr

from kine2go_warp.cli.main import main
from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.env.terms.randomization import RANDOMIZATION, randomized
from kine2go_warp.robots import GO2
from kine2go_warp.rollouts.config import GatherConfig
from kine2go_warp.rollouts.gather import gather
from kine2go_warp.rollouts.replay import replay_motion
from tests.conftest import ANYTHING_GOES
from tests.env.helpers import EVERYTHING

WILD = randomized(EVERYTHING, push_speed=(0.1, 0.3))


@pytest.fixture(scope="module")
def dataset(policy, tmp_path_factory):
    """Rollouts of a poor policy with everything drawn, pushes included."""
    path = tmp_path_factory.mktemp("replay") / "dataset.zarr"
    config = GatherConfig(trajectories=4, rows=90, num_worlds=8, randomization=WILD, max_attempts=16.0, **ANYTHING_GOES)
    gather(policy, DatasetWriter(path, GO2), config, "cpu")
    assert (open_dataset(path, include_rejected=True).load("dog_trot").trajectories.rows["push"] != 0.0).any()
    return path


def test_every_trajectory_comes_out_bit_for_bit_alone_in_a_world(dataset):
    results = replay_motion(dataset, "dog_trot", None, "newton", "cpu")
    assert len(results) == 4
    for result in results:
        assert result.is_identical, result
        assert result.num_rows == 90
        assert max(result.root_difference[:3]) == 0.0
        assert np.isnan(result.root_difference[3]), "the rows end before 2 s"


def test_plain_mujoco_agrees_within_a_millimetre_for_a_quarter_of_a_second(dataset):
    for result in replay_motion(dataset, "dog_trot", None, "mujoco", "cpu"):
        assert not result.is_identical, "another engine in another precision"
        assert result.root_difference[0] < 1e-3
        assert result.joint_difference[0] < 1e-3
        assert result.angle_difference[0] < 1e-3


def test_the_command_prints_a_table_and_succeeds(dataset, capsys):
    assert main(["replay", str(dataset), "dog_trot", "1"]) == 0
    output = capsys.readouterr().out
    assert "dog_trot" in output
    assert "all" in output


@pytest.mark.parametrize("name", ["joint_target", "initial_state/joint_qd", "initial_state/friction"])
def test_a_change_of_anything_that_counts_is_noticed(dataset, tmp_path, name, capsys):
    changed = tmp_path / "changed.zarr"
    shutil.copytree(dataset, changed)
    array = zarr.open_group(changed / "dog_trot", mode="a", use_consolidated=False)[name]
    values = np.asarray(array[...])
    values[0] *= np.float32(0.99)
    array[...] = values
    assert main(["replay", str(changed), "dog_trot", "0"]) == 1
    assert "before row" in capsys.readouterr().out


def test_data_of_a_gpu_are_replayed_on_a_machine_without_one(dataset, tmp_path, capsys):
    copy = tmp_path / "of_a_gpu.zarr"
    shutil.copytree(dataset, copy)
    motion = zarr.open_group(copy / "dog_trot", mode="r+", use_consolidated=False)
    motion.attrs["device"] = "cuda:5"
    motion["joint_target"][0] = 0.99 * motion["joint_target"][0]
    zarr.consolidate_metadata(copy)
    assert main(["dataset", "replay", str(copy), "dog_trot", "0"]) == 0, "rounding may differ, so nothing must agree"
    assert "gathered on cuda:5, which is not here; on cpu a replay agrees to rounding" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["dog_trot", "9"], "has trajectories 0 to 3, not 9"),
        (["wolf"], "holds no motion 'wolf'"),
        (["dog_trot", "--count", "0"], "count is 0; it must be at least 1"),
    ],
)
def test_wrong_requests_are_refused_in_one_line(dataset, arguments, message, capsys):
    assert main(["replay", str(dataset), *arguments]) == 2
    assert message in capsys.readouterr().err


def test_the_initial_state_is_that_of_the_first_kept_row(dataset):
    rows = open_dataset(dataset, include_rejected=True).load("dog_trot").trajectories.rows
    group = zarr.open_group(dataset / "dog_trot", mode="r")
    joint_q = np.asarray(group["initial_state/joint_q"][...])
    np.testing.assert_array_equal(joint_q[:, :3], rows["root_position"][:, 0])
    np.testing.assert_array_equal(joint_q[:, 7:], rows["joint_position"][:, 0])
    friction = np.asarray(group["randomization/friction"][...])
    np.testing.assert_array_equal(friction, np.asarray(group["initial_state/friction"][...]))
    assert np.ptp(friction) > 0.05


def test_without_randomisation_it_comes_out_too(policy, tmp_path):
    config = GatherConfig(trajectories=2, rows=30, **ANYTHING_GOES)
    config = replace(config, randomization=RANDOMIZATION)
    gather(policy, DatasetWriter(tmp_path / "d.zarr", GO2), config, "cpu")
    assert all(result.is_identical for result in replay_motion(tmp_path / "d.zarr", "dog_trot", None, "newton", "cpu"))
