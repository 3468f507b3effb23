"""The exported policy in plain MuJoCo beside Newton."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from kine2go_warp.cli.main import main
from kine2go_warp.deployment.controller import ExportedPolicy
from kine2go_warp.env.config import TerrainConfig
from kine2go_warp.errors import PolicyError
from kine2go_warp.evaluation.config import EvalConfig
from kine2go_warp.evaluation.mujoco import MujocoRollouts
from kine2go_warp.evaluation.sim2sim import apart, sim2sim
from kine2go_warp.learning.presets import FAST
from kine2go_warp.robots import GO2
from kine2go_warp.rollouts.rollout import InitialStates

SHORT = EvalConfig(worlds=4, seconds=1.0)


@pytest.fixture(scope="module")
def loaded(exported):
    return ExportedPolicy.load(exported)


def test_both_simulations_agree_within_a_tenth_of_a_millimetre_for_half_a_second(policy, loaded):
    (found,) = sim2sim(policy, loaded, replace(SHORT, seconds=0.5), "cpu")
    assert found.apart[0.5] < 1e-4
    for name, values in found.newton.metrics.items():
        np.testing.assert_allclose(found.mujoco.metrics[name], values, rtol=1e-2, atol=1e-5, err_msg=name)
    assert found.newton.survival == found.mujoco.survival
    np.testing.assert_allclose(found.newton.joint_error, found.mujoco.joint_error, atol=3e-3)


@pytest.mark.parametrize("change", [{"latency": 0.0}, {"stiffness": 50.0}])
def test_wrong_metadata_show(policy, loaded, change):
    wrong = replace(loaded, metadata=replace(loaded.metadata, **change))
    (found,) = sim2sim(policy, wrong, replace(SHORT, worlds=2), "cpu")
    assert found.apart[0.5] > 1e-3


def initial_at(height, count=1):
    joint_q = np.zeros((count, 19), np.float32)
    joint_q[:, 2], joint_q[:, 6] = height, 1.0
    joint_q[:, 7:] = GO2.default_joint_position
    return InitialStates(np.zeros(count), np.zeros(count), joint_q, np.zeros((count, 18), np.float32))


@pytest.mark.parametrize(
    ("height", "limits", "reason"),
    [
        (0.05, {"max_distance": 9.0}, "body_contact"),
        (2.0, {"max_distance": 0.5}, "distance"),
        (0.32, {"max_distance": 9.0, "max_angle": 1e-4}, "rotation"),
    ],
)
def test_rollouts_end_for_the_reasons_of_the_environment(loaded, height, limits, reason):
    mujoco = MujocoRollouts(loaded, FAST.env, replace(SHORT, **limits))
    batch = mujoco.run(0, initial_at(height))
    assert batch.failure[0] == reason
    rows = batch.rows(np.array([0]))
    assert np.isnan(rows["root_position"][0, batch.length[0] :]).all()
    assert batch.length[0] < 60
    assert np.isfinite(rows["link_position"][0, : batch.length[0]]).all()


def test_rows_apart_are_medians_over_rollouts_that_last():
    class Rows:
        def __init__(self, offset):
            self.values = np.zeros((3, 60, 3)) + offset
            self.values[2, 20:] = np.nan

        def read(self, _, chosen):
            return self.values[chosen]

    found = apart(Rows(0.0), Rows(np.array([0.03, 0.0, 0.04])), np.arange(3), 60.0)
    assert found == {0.5: pytest.approx(0.05), 1.0: pytest.approx(0.05)}


def test_rough_ground_and_another_checkpoint_are_refused(policy, loaded):
    rough = replace(FAST.env, terrain=TerrainConfig(kind="waves"))
    with pytest.raises(PolicyError, match="trained on waves"):
        MujocoRollouts(loaded, rough, SHORT)
    other = replace(loaded, metadata=replace(loaded.metadata, checkpoint_sha256="0"))
    with pytest.raises(PolicyError, match="of another checkpoint"):
        sim2sim(policy, other, SHORT, "cpu")


def test_the_command_exports_by_itself_and_writes_both_results(policy, tmp_path, capsys):
    folder = shutil.copytree(policy.path, tmp_path / "policy")
    arguments = ["sim2sim", str(folder), "--worlds", "2", "--seconds", "0.5", "--device", "cpu"]
    assert main(arguments) == 0
    printed = capsys.readouterr().out
    assert "MuJoCo" in printed
    assert "roots apart" in printed
    clips = json.loads((folder / "sim2sim.json").read_text())["clips"]
    assert [one["condition"] for one in clips[0]["results"]] == ["Newton", "MuJoCo"]
    assert list(clips[0]["roots_apart"]) == ["0.5 s"]
    assert main(["export-policy", str(folder)]) == 2
    assert "--overwrite" in capsys.readouterr().err
