"""Exported policies against the weights of their checkpoints, and what comes with them."""

import json
import shutil
from dataclasses import replace

import numpy as np
import onnx
import pytest
import torch
import yaml

from kine2go_warp.cli.main import main
from kine2go_warp.deployment import export
from kine2go_warp.deployment.controller import ExportedPolicy
from kine2go_warp.deployment.export import export_policy
from kine2go_warp.deployment.metadata import (
    METADATA_FILE,
    METADATA_KEY,
    OBSERVATION_FILE,
    TORCHSCRIPT_EXTRA,
    PolicyMetadata,
    read_metadata,
)
from kine2go_warp.errors import PolicyError
from kine2go_warp.learning.checkpoint import load_checkpoint
from kine2go_warp.robots import GO2


def by_hand(policy, observation):
    """The mean output from the checkpoint's numbers alone, in double precision."""
    weights = load_checkpoint(policy.latest_checkpoint(), "cpu")["actor_state_dict"]
    weights = {name: value.double().numpy() for name, value in weights.items()}
    scale = weights["obs_normalizer._std"] + 1e-2
    value = (observation.astype(float) - weights["obs_normalizer._mean"]) / scale
    layers = sorted(name for name in weights if name.startswith("mlp.") and name.endswith("weight"))
    for layer in layers:
        value = value @ weights[layer].T + weights[layer.replace("weight", "bias")]
        if layer != layers[-1]:
            value = np.where(value > 0.0, value, np.expm1(np.minimum(value, 0.0)))
    return value


@pytest.mark.parametrize("count", [1, 7])
def test_both_models_are_the_checkpoints_network_with_its_normaliser(policy, exported, rng, count):
    loaded = ExportedPolicy.load(exported)
    observation = rng.normal(0.0, 1.0, (count, loaded.metadata.observation_size)).astype(np.float32)
    expected = by_hand(policy, observation)
    assert np.ptp(expected) > 0.1
    script = torch.jit.load(exported / "policy.pt")
    np.testing.assert_allclose(loaded.infer(observation), expected, atol=1e-5)
    np.testing.assert_allclose(script(torch.from_numpy(observation)).detach().numpy(), expected, atol=1e-5)


def test_both_models_hold_what_the_two_files_say_once(exported):
    extra = {TORCHSCRIPT_EXTRA: ""}
    torch.jit.load(exported / "policy.pt", _extra_files=extra)
    inside = {entry.key: entry.value for entry in onnx.load(exported / "policy.onnx").metadata_props}[METADATA_KEY]
    drive = yaml.safe_load((exported / METADATA_FILE).read_text())
    observation = json.loads((exported / OBSERVATION_FILE).read_text())
    assert not drive.keys() & observation.keys(), "no fact is in both files"
    assert json.loads(inside) == json.loads(extra[TORCHSCRIPT_EXTRA]) == drive | observation
    assert PolicyMetadata.from_json(inside, "") == read_metadata(exported)


def test_the_model_says_the_lowest_versions_that_its_operators_need(exported):
    """ONNX Runtime 1.16 reads operator sets up to 19 and files up to version 9."""
    model = onnx.load(exported / "policy.onnx")
    assert {node.op_type for node in model.graph.node} == {"Sub", "Div", "Gemm", "Elu"}
    # Sub and Div were last changed in operator set 14, which came with version 7 of the file.
    assert ([one.version for one in model.opset_import], model.ir_version) == ([14], 7)


def test_the_metadata_say_what_a_robot_needs(policy, exported, clip):
    metadata = read_metadata(exported)
    assert metadata.joint_names == GO2.joint_names
    assert metadata.default_joint_position == GO2.default_joint_position
    assert metadata.torque_limit == GO2.joint_effort
    assert (metadata.stiffness, metadata.damping) == (60.0, 2.0)
    assert (metadata.control_rate, metadata.physics_rate, metadata.substeps) == (60.0, 240.0, 4)
    assert metadata.latency == pytest.approx(5 / 240)
    assert metadata.latency_substeps == 5
    assert (metadata.action.mode, metadata.action.scale, metadata.action.clip) == ("residual_ff", 0.25, 100.0)
    assert metadata.action.needs_reference
    assert metadata.action.reference_lead == pytest.approx(1.0 + 5 / 4)
    assert metadata.clips[0].content_hash == clip.content_hash()
    table = json.loads(policy.record_file.read_text())["observation"]
    assert [vars(row) for row in metadata.observation] == table
    assert max(metadata.parity.onnx, metadata.parity.torchscript) <= 1e-5


def test_the_page_has_every_row_and_every_joint(exported):
    page = (exported / "README.md").read_text()
    metadata = read_metadata(exported)
    for name in (*(row.name for row in metadata.observation), *metadata.joint_names, metadata.clips[0].licence):
        assert name in page


def test_the_page_says_which_sdk_motor_each_output_goes_to(exported):
    """Case sdk-order-on-the-page: Unitree numbers the motors FR, FL, RR, RL, the policy its joints FL, FR, RL, RR."""
    page = (exported / "README.md").read_text().splitlines()
    table = {
        row.split("|")[1].strip(" `"): [cell.strip() for cell in row.split("|")[2:-1]]
        for row in page
        if "_joint`" in row
    }
    expected = {"FL": 3, "FR": 0, "RL": 9, "RR": 6}
    limits = zip(GO2.joint_names, GO2.joint_lower, GO2.joint_upper, strict=True)
    rows = yaml.safe_load((exported / METADATA_FILE).read_text())["joints"]
    for place, (name, lower, upper) in enumerate(limits):
        assert (rows[place]["name"], rows[place]["sdk_index"]) == (name, GO2.sdk_motor_order.index(name))
        output, motor, _, limit, _ = table[name]
        assert int(output) == place
        assert int(motor) == expected[name[:2]] + ("hip", "thigh", "calf").index(name.split("_")[1])
        assert limit == f"{lower:g} to {upper:g}"


def test_an_export_that_disagrees_is_refused_and_the_older_one_stays(policy, exported, tmp_path, monkeypatch):
    folder = shutil.copytree(exported, tmp_path / "export")
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    write = export.write_onnx

    def write_another(actor, size, path):
        with torch.no_grad():
            actor.model.mlp[0].bias += 1e-3
        write(actor, size, path)
        with torch.no_grad():
            actor.model.mlp[0].bias -= 1e-3

    monkeypatch.setattr(export, "write_onnx", write_another)
    with pytest.raises(PolicyError, match="ONNX model differs from the policy by"):
        export_policy(policy, folder, overwrite=True)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    assert [path.name for path in tmp_path.iterdir()] == ["export"]


def test_only_an_export_is_replaced_and_only_when_told(policy, exported, tmp_path, capsys):
    folder = shutil.copytree(exported, tmp_path / "export")
    (tmp_path / "diary").mkdir()
    (tmp_path / "diary" / "monday.txt").write_text("rain")
    with pytest.raises(PolicyError, match="--overwrite"):
        export_policy(policy, folder)
    with pytest.raises(PolicyError, match="is no exported policy"):
        export_policy(policy, tmp_path / "diary", overwrite=True)
    (folder / "policy.onnx").write_bytes(b"")
    assert main(["export-policy", str(policy.path), "--out", str(folder), "--overwrite"]) == 0
    assert "policy.onnx" in capsys.readouterr().out
    assert read_metadata(folder) == read_metadata(exported)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["diary", "export"]


def spoil_model(folder):
    (folder / "policy.onnx").write_bytes((folder / "policy.onnx").read_bytes()[:1000])


def spoil_clip(folder):
    (folder / "dog_trot.npz").write_bytes(b"another clip")


def forget_metadata(folder):
    model = onnx.load(folder / "policy.onnx")
    del model.metadata_props[:]
    onnx.save(model, folder / "policy.onnx")


def another_version(folder):
    model = onnx.load(folder / "policy.onnx")
    metadata = replace(read_metadata(folder), format_version=99)
    onnx.helper.set_model_props(model, {METADATA_KEY: metadata.to_json()})
    onnx.save(model, folder / "policy.onnx")


def turn_up_a_gain(folder):
    file = folder / METADATA_FILE
    file.write_text(file.read_text().replace("stiffness: 60.0", "stiffness: 600.0"))


def move_a_row(folder):
    file = folder / OBSERVATION_FILE
    file.write_text(file.read_text().replace('"start": 3', '"start": 4', 1))


def an_older_export(folder):
    (folder / METADATA_FILE).rename(folder / "metadata.json")


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (turn_up_a_gain, "not what policy.onnx holds"),
        (move_a_row, "not what policy.onnx holds"),
        (an_older_export, "export of an older version"),
        (lambda folder: (folder / METADATA_FILE).write_text("a: [1"), "cannot be read as YAML"),
        (lambda folder: (folder / METADATA_FILE).write_text("- 1"), "cannot be read"),
        (lambda folder: (folder / OBSERVATION_FILE).write_text("{}"), "cannot be read"),
        (lambda folder: (folder / OBSERVATION_FILE).unlink(), "missing"),
        (spoil_model, "not an ONNX model that can be read"),
        (spoil_clip, "not the clip that was exported"),
        (forget_metadata, "no metadata that can be read"),
        (another_version, "export format 99"),
        (shutil.rmtree, "no exported policy here"),
    ],
)
def test_an_export_that_cannot_be_used_is_told_in_one_line(exported, tmp_path, spoil, message):
    folder = shutil.copytree(exported, tmp_path / "export")
    spoil(folder)
    with pytest.raises(PolicyError, match=message) as error:
        ExportedPolicy.load(folder)
    assert "\n" not in str(error.value)
