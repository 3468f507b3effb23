"""The page that goes with an exported policy."""

from kine2go_warp.deployment.metadata import (
    INPUT_NAME,
    METADATA_FILE,
    METADATA_KEY,
    OBSERVATION_FILE,
    ONNX_FILE,
    OUTPUT_NAME,
    TORCHSCRIPT_FILE,
    PolicyMetadata,
)
from kine2go_warp.tables import Cell, make_table, markdown

USAGE = f"""```python
import json, numpy as np, onnxruntime

session = onnxruntime.InferenceSession("policy.onnx")
metadata = json.loads(session.get_modelmeta().custom_metadata_map["{METADATA_KEY}"])
observation = np.zeros((1, metadata["observation"][-1]["stop"]), np.float32)  # as in the table below
(output,) = session.run(["{OUTPUT_NAME}"], {{"{INPUT_NAME}": observation}})
```

TorchScript: `torch.jit.load("policy.pt")(observation)`. With kine2go-warp, `kine2go deploy` drives a robot with this
folder, and `PolicyController` of `kine2go_warp.deployment.controller` builds the observations from measured states and
returns joint targets."""


def policy_card(metadata: PolicyMetadata) -> str:
    """Return the page as Markdown."""
    action = metadata.action
    joints = make_table(
        "",
        ("joint", "output", "SDK motor", "default position [rad]", "limits [rad]", "torque limit [N m]"),
        (
            (
                Cell(joint.name, code=True),
                joint.policy_index,
                joint.sdk_index,
                f"{joint.default_position:g}",
                f"{joint.lower:g} to {joint.upper:g}",
                f"{joint.torque_limit:g}",
            )
            for joint in metadata.joints
        ),
    )
    parts = make_table(
        "",
        ("name", "from", "to", "unit", "meaning"),
        ((Cell(one.name, code=True), one.start, one.stop, one.unit, one.description) for one in metadata.observation),
    )
    clips = "\n".join(
        f"- `{clip.file}`: {clip.num_frames} frames of {clip.frame_duration:.6g} s a cycle. "
        f"Licence: {clip.licence or 'not known'}. Source: {clip.citation or 'not known'}."
        for clip in metadata.clips
    )
    return f"""# {metadata.policy}

A policy that tracks motion clips with a {metadata.robot}, trained for {metadata.iterations} iterations; exported by
kine2go-warp {metadata.software_version}. `{METADATA_FILE}` has all of this for machines, and
`{OBSERVATION_FILE}` the table of the observation; `{ONNX_FILE}` and `{TORCHSCRIPT_FILE}` hold both inside.
The normaliser: {metadata.normaliser}. Both models give the policy's mean output; they differ from it by at most
{metadata.parity.onnx:.1e} (ONNX) and {metadata.parity.torchscript:.1e} (TorchScript) on {metadata.parity.observations}
observations.

{USAGE}

## From the output to torques

- Once every 1/{metadata.control_rate:g} s: {action.meaning}.
- scale {action.scale:g} rad; outputs are clipped to +-{action.clip:g}; reference_lead {action.reference_lead:g} control
  steps; velocity_gain {action.velocity_gain:.6g} s.
- {metadata.torque_rule} stiffness {metadata.stiffness:g} N m/rad, damping {metadata.damping:g} N m s/rad, physics_rate
  {metadata.physics_rate:g} Hz, latency {1e3 * metadata.latency:.3g} ms.

Outputs of the policy, and joints in the observation, are in the order of the column "output". The manufacturer's SDK
numbers the motors as in "SDK motor": a joint's target goes there, or it reaches another leg.

{markdown(joints)}
## Clips

The observation looks ahead in the clip, so that a clip is needed at run time. A cycle's end is its beginning moved on
by the cycle's displacement; between frames positions are interpolated linearly and rotations along the shorter arc.

{clips}

## Observation

{metadata.observation_size} numbers. {metadata.history_rule}

{markdown(parts)}"""
