"""Deploy bundles that need no training: of policies that return zeros, and of one that was trained once."""

from types import SimpleNamespace

import numpy as np
import pytest

from kine2go_warp.learning.presets import FAST, NO_STATE_ESTIMATION
from tests.conftest import COMMITTED_CLIP

TRAINED = COMMITTED_CLIP.with_name("trot_policy.npz")
"""Layers of a policy of the preset ``no_state_estimation`` that tracks the bundled trot, in half precision."""


def write_bundle(folder, preset, layers=None):
    """Write a bundle with the functions that export one, from a network put together here; without layers of zeros."""
    onnx = pytest.importorskip("onnx")
    from kine2go_warp.deployment import export
    from kine2go_warp.deployment.metadata import INPUT_NAME, METADATA_KEY, ONNX_FILE, OUTPUT_NAME, Parity
    from kine2go_warp.env.observations import observation_size
    from kine2go_warp.motions.clip import MotionClip
    from kine2go_warp.robots import GO2

    folder.mkdir()
    clip = MotionClip.load(COMMITTED_CLIP)
    record = SimpleNamespace(preset=preset, policy_iterations=0, fingerprint="", clips=(COMMITTED_CLIP.name,))
    policy = SimpleNamespace(path=COMMITTED_CLIP.parent, checkpoint_hash=lambda: "", read_clips=lambda _: (clip,))
    clips = export.copy_clips(policy, record, folder)
    metadata = export.describe(policy, record, clips, Parity(0.0, 0.0, 0), GO2)
    size, helper, real = observation_size(preset.env), onnx.helper, onnx.TensorProto.FLOAT
    if layers is None:
        layers = {"mean": np.zeros(size), "std": np.ones(size), "weight0": np.zeros((12, size)), "bias0": np.zeros(12)}
    nodes = [helper.make_node("Sub", [INPUT_NAME, "mean"], ["x"]), helper.make_node("Div", ["x", "std"], ["value0"])]
    count = sum(name.startswith("weight") for name in layers)
    for layer in range(count):
        names, is_last = [f"value{layer}", f"weight{layer}", f"bias{layer}"], layer == count - 1
        nodes.append(helper.make_node("Gemm", names, [OUTPUT_NAME if is_last else f"sum{layer}"], transB=1))
        if not is_last:
            nodes.append(helper.make_node("Elu", [f"sum{layer}"], [f"value{layer + 1}"]))
    graph = helper.make_graph(
        nodes,
        "policy",
        [helper.make_tensor_value_info(INPUT_NAME, real, ["observations", size])],
        [helper.make_tensor_value_info(OUTPUT_NAME, real, ["observations", 12])],
        [onnx.numpy_helper.from_array(np.float32(values), name) for name, values in layers.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 14)], ir_version=7)
    helper.set_model_props(model, {METADATA_KEY: metadata.to_json()})
    onnx.save(model, folder / ONNX_FILE)
    metadata.write(folder)
    return folder


@pytest.fixture(scope="session")
def bundle(tmp_path_factory):
    """Of a policy that needs an estimate of the root and returns zeros: joint targets are the clip's own."""
    return write_bundle(tmp_path_factory.mktemp("bundle") / "trot", FAST)


@pytest.fixture(scope="session")
def trained_bundle(tmp_path_factory):
    """Of a trained policy that observes what a robot measures."""
    with np.load(TRAINED) as layers:
        return write_bundle(tmp_path_factory.mktemp("trained") / "trot", NO_STATE_ESTIMATION, dict(layers))
