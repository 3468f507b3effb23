"""The heaviest robot of the package, from the bundled motion to data by the commands of docs/adding-a-robot.md."""

import numpy as np
import pytest

from kine2go_warp.cli.main import main
from kine2go_warp.dataset import open_dataset
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.motions.catalogue import motion_named
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.motions.inverse_kinematics import InverseKinematics
from kine2go_warp.motions.quality import assess, clip_remarks
from kine2go_warp.motions.retarget import retarget
from kine2go_warp.robots import robot_named
from tests.conftest import ANYTHING_GOES

B2 = robot_named("b2")


@pytest.mark.parametrize("name", ["a1", "go1", "b2"])
def test_the_bundled_trot_is_retargeted_without_faults_in_the_robots_size(name, clip):
    spec = robot_named(name)
    result = retarget(motion_named("dog_trot"), None, InverseKinematics(spec), RetargetConfig())
    quality = assess(result, spec)
    assert clip_remarks(quality) == []
    assert result.clip.robot == name
    assert result.clip.cycle.x == pytest.approx(spec.size * clip.cycle.x, rel=1e-6)
    assert result.clip.root_position[:, 2].mean() == pytest.approx(
        spec.foot_radius + spec.size * (clip.root_position[:, 2].mean() - 0.022), rel=1e-6
    )
    # Feet stand as far outside the hips as the thighs are, on every robot.
    lateral = np.abs(result.clip.foot_position[:, :, 1] - result.clip.root_position[:, None, 1]).mean(axis=0)
    assert lateral == pytest.approx(np.full(4, spec.legs[0].hip_offset[1] + spec.legs[0].thigh_offset[1]), rel=0.05)


@pytest.mark.slow
def test_the_commands_make_data_that_repeat_bit_for_bit(tmp_path, monkeypatch):
    """Two iterations, so the policy is not good: the robot, its gains and its motion go through all stages."""
    monkeypatch.chdir(tmp_path)
    loose = " ".join(f"--{name.replace('_', '-')} {value}" for name, value in ANYTHING_GOES.items())
    for command in (
        "motion retarget dog_trot --robot b2 --out clips",
        "policy train clips/dog_trot.npz --out policy --num-worlds 8 --iterations 2 --processes 1 --device cpu",
        f"dataset gather policy --out data.zarr --trajectories 2 --rows 30 --warm-up 0.1 --device cpu {loose}",
        "dataset replay data.zarr",
        "dataset check data.zarr",
        "policy export policy",
        "policy sim2sim policy --worlds 2 --seconds 0.5 --device cpu",
    ):
        assert main(command.split()) == 0, command
    data = open_dataset(tmp_path / "data.zarr")
    assert (data.robot, PolicyFolder(tmp_path / "policy").robot) == (B2, B2)
    loaded = data.load("dog_trot")
    stiffness, damping = data.attributes["stiffness"], data.attributes["damping"]
    assert (stiffness, damping) == pytest.approx((6.4 * 60.0, 10.0 * 2.0))
    assert np.abs(loaded.trajectories.rows["joint_torque_peak"]).max() > 35.55, "more than any motor of the Go2 gives"
