"""Exporting a policy: a bundle that stands on its own, checked against the policy that it came from."""

import contextlib
import io
import logging
import shutil
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from kine2go_warp import __version__
from kine2go_warp.deployment.card import policy_card
from kine2go_warp.deployment.controller import ExportedPolicy, open_session
from kine2go_warp.deployment.metadata import (
    ACTION_MEANINGS,
    FORMAT_VERSION,
    HISTORY_RULE,
    INPUT_NAME,
    METADATA_FILE,
    METADATA_KEY,
    ONNX_FILE,
    OUTPUT_NAME,
    TORCHSCRIPT_EXTRA,
    TORCHSCRIPT_FILE,
    TORQUE_RULE,
    ActionRule,
    JointRow,
    ObservationRow,
    Parity,
    PolicyMetadata,
    ReferenceClip,
)
from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.observations import observation_layout
from kine2go_warp.errors import PolicyError
from kine2go_warp.files import atomic_folder, sha256_of
from kine2go_warp.learning.inference import NoisyPolicy
from kine2go_warp.learning.policy import PolicyFolder, PolicyRecord
from kine2go_warp.learning.vec_env import ImitationVecEnv
from kine2go_warp.revision import revision
from kine2go_warp.robots import RobotSpec

TOLERANCE = 1e-5
"""Largest difference of an output that an export may have."""

REAL_WORLDS, REAL_STEPS, RANDOM_SPREAD = 8, 60, 3.0
"""Real observations: worlds and control steps. Random ones scatter this many times as widely as the real ones."""

OPSET = 18
"""What torch exports at best; the file says the lowest that its operators need."""


def default_folder(policy: PolicyFolder) -> Path:
    """Return where an export goes if nothing else is said."""
    return policy.path / "export"


def up_to_date_export(policy: PolicyFolder) -> Path:
    """Return the default folder of a policy's export, written first if it is missing or of other weights.

    Raises:
        PolicyError: the policy cannot be read.
    """
    folder = default_folder(policy)
    policy.read_record()
    checkpoint = policy.checkpoint_hash()
    if not folder.exists() or ExportedPolicy.load(folder).metadata.checkpoint_sha256 != checkpoint:
        export_policy(policy, folder, overwrite=True)
    return folder


def export_policy(policy: PolicyFolder, out: Path, overwrite: bool = False) -> PolicyMetadata:
    """Export the newest checkpoint of a policy to ONNX and TorchScript, with metadata and clips.

    Args:
        policy: A trained policy.
        out: Folder to create.
        overwrite: Replace an older export at ``out``.

    Raises:
        PolicyError: the policy cannot be read, ``out`` may not be replaced, or the exported models disagree with the
            policy; nothing is written then.
    """
    check_target(out, overwrite)
    record = policy.read_record()
    actor, observations = actor_and_observations(policy, record)
    with atomic_folder(out) as staging:
        clips = copy_clips(policy, record, staging)
        write_onnx(actor, observations.shape[1], staging / ONNX_FILE)
        script = scripted(actor)
        parity = check_parity(actor, staging / ONNX_FILE, script, observations)
        metadata = describe(policy, record, clips, parity, policy.robot)
        text = metadata.to_json()
        add_metadata(staging / ONNX_FILE, text)
        with quiet_exporter():
            torch.jit.save(script, staging / TORCHSCRIPT_FILE, _extra_files={TORCHSCRIPT_EXTRA: text})
        metadata.write(staging)
        (staging / "README.md").write_text(policy_card(metadata))
    return metadata


def check_target(out: Path, overwrite: bool) -> None:
    """Check that an export may be written to a folder.

    Raises:
        PolicyError: something lies there, and it is no export or may not be replaced.
    """
    if not out.exists() or (out.is_dir() and not any(out.iterdir())):
        return
    if not (out / METADATA_FILE).is_file():
        raise PolicyError(f"{out}: exists and is no exported policy; choose another folder with --out")
    if not overwrite:
        raise PolicyError(f"{out}: holds an exported policy already; replace it with --overwrite")


def actor_and_observations(policy: PolicyFolder, record: PolicyRecord) -> tuple[NoisyPolicy, torch.Tensor]:
    """Return the policy, and real and random observations to try it on, shape [num_observations, size]."""
    settings = replace(record.preset.env, num_worlds=REAL_WORLDS, privileged=False)
    env = ImitationVecEnv(ImitationEnvironment(policy.read_clips(record), settings, "cpu"))
    actor = NoisyPolicy(env, record.preset, policy.latest_checkpoint(), settings.seed)
    observation, real = env.get_observations(), []
    for _ in range(REAL_STEPS):
        real.append(observation["policy"])
        observation, *_ = env.step(actor(observation, 1.0)[1])
    seen = torch.cat(real)
    generator = torch.Generator().manual_seed(settings.seed)
    scatter = torch.randn(seen.shape, generator=generator)
    return actor, torch.cat([seen, seen.mean(dim=0) + RANDOM_SPREAD * seen.std(dim=0) * scatter])


def copy_clips(policy: PolicyFolder, record: PolicyRecord, folder: Path) -> tuple[ReferenceClip, ...]:
    """Copy the clips beside the model, and describe them."""
    described = []
    for name, clip in zip(record.clips, policy.read_clips(record), strict=True):
        shutil.copyfile(policy.path / name, folder / name)
        described.append(
            ReferenceClip(
                name=clip.name,
                file=name,
                sha256=sha256_of(folder / name),
                content_hash=clip.content_hash(),
                num_frames=clip.num_frames,
                frame_duration=clip.frame_duration,
                licence=clip.origin.licence,
                citation=clip.origin.citation,
            )
        )
    return tuple(described)


@contextlib.contextmanager
def quiet_exporter() -> Iterator[None]:
    """Drop what torch prints and warns of while it exports."""
    logger = logging.getLogger("torch.onnx")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.setLevel(level)


def write_onnx(actor: NoisyPolicy, size: int, path: Path) -> None:
    """Write the mean output as an ONNX model of any number of observations, the normaliser inside."""
    module = actor.model.as_onnx(verbose=False).eval()
    with quiet_exporter():
        torch.onnx.export(
            module,
            (torch.zeros(2, size),),
            str(path),
            input_names=[INPUT_NAME],
            output_names=[OUTPUT_NAME],
            dynamic_shapes=({0: torch.export.Dim("observations")},),
            opset_version=OPSET,
            dynamo=True,
            external_data=False,
        )
    lower_versions(path)


def lower_versions(path: Path) -> None:
    """Say in an ONNX model the lowest operator set and file format that it needs, so that older runtimes load it.

    Between the operator set in which an operator was last changed and ``OPSET`` it means the same.
    """
    import onnx

    model = onnx.load(path)
    # Notes of the exporter, in fields that the older format does not have.
    for part in (model.graph, *model.graph.node, *model.graph.initializer, *model.graph.input, *model.graph.output):
        part.ClearField("metadata_props")
    operators = {node.op_type for node in model.graph.node}
    model.opset_import[0].version = max(onnx.defs.get_schema(name, OPSET).since_version for name in operators)
    model.ir_version = onnx.helper.find_min_ir_version_for(model.opset_import)
    onnx.checker.check_model(model, full_check=True)
    onnx.save(model, path)


def scripted(actor: NoisyPolicy) -> torch.jit.ScriptModule:
    """Return the mean output as TorchScript, the normaliser inside."""
    with quiet_exporter():
        return torch.jit.script(actor.model.as_jit().eval())


def check_parity(
    actor: NoisyPolicy, onnx_file: Path, script: torch.jit.ScriptModule, observations: torch.Tensor
) -> Parity:
    """Compare the exported models with the policy.

    Raises:
        PolicyError: they differ by more than ``TOLERANCE``.
    """
    with torch.inference_mode():
        expected = actor({"policy": observations}, 0.0)[0].numpy()  # pyright: ignore[reportArgumentType]
        from_script = script(observations).numpy()
    session = open_session(onnx_file)
    from_onnx = session.run([OUTPUT_NAME], {INPUT_NAME: observations.numpy()})[0]
    parity = Parity(furthest(from_onnx, expected), furthest(from_script, expected), len(observations))
    for name, difference in (("ONNX", parity.onnx), ("TorchScript", parity.torchscript)):
        # Written so that NaN fails.
        if not difference <= TOLERANCE:
            raise PolicyError(f"the {name} model differs from the policy by {difference:.2g}, more than {TOLERANCE:g}")
    return parity


def furthest(one: NDArray[Any], other: NDArray[Any]) -> float:
    """Return the largest difference."""
    return float(np.abs(one.astype(np.float64) - other).max())


def describe(
    policy: PolicyFolder, record: PolicyRecord, clips: tuple[ReferenceClip, ...], parity: Parity, spec: RobotSpec
) -> PolicyMetadata:
    """Return the metadata of a policy."""
    config = record.preset.env
    stiffness, damping = config.motor.gains(spec)
    return PolicyMetadata(
        format_version=FORMAT_VERSION,
        software_version=__version__,
        revision=revision(),
        policy=policy.path.resolve().name,
        iterations=record.policy_iterations,
        checkpoint_sha256=policy.checkpoint_hash(),
        fingerprint=record.fingerprint,
        robot=spec.name,
        robot_model_sha256=spec.model_hash,
        joints=joint_table(spec),
        stiffness=stiffness,
        damping=damping,
        torque_rule=TORQUE_RULE,
        control_rate=config.control_rate,
        physics_rate=config.control_rate * config.substeps,
        latency=config.delay_substeps * config.substep_duration,
        action=action_rule(config, spec),
        normaliser="inside the model" if record.preset.ppo.obs_normalization else "none",
        observation=tuple(
            ObservationRow(row.name, row.start, row.stop, row.unit, row.description)
            for row in observation_layout(config)
        ),
        history_rule=HISTORY_RULE,
        clips=clips,
        parity=parity,
        motor_limits=spec.motor_limits if config.motor.torque_speed else None,
        joint_friction=config.motor.joint_friction(spec),
    )


def joint_table(spec: RobotSpec) -> tuple[JointRow, ...]:
    """Return what each output of the policy belongs to."""
    columns = (spec.default_joint_position, spec.joint_lower, spec.joint_upper, spec.joint_effort)
    return tuple(
        JointRow(name, place, spec.sdk_motor_order.index(name), *values)
        for place, (name, *values) in enumerate(zip(spec.joint_names, *columns, strict=True))
    )


def action_rule(config: EnvConfig, spec: RobotSpec) -> ActionRule:
    """Return how the environment turns outputs into a robot's joint targets."""
    stiffness, damping = config.motor.gains(spec)
    # The reference alone is the reference with its velocity counting nothing.
    mode = "residual_ff" if config.action.mode == "residual" else config.action.mode
    return ActionRule(
        mode=mode,
        scale=config.action.scale,
        clip=config.action.clip,
        reference_lead=1.0 + config.delay_substeps / config.substeps,
        velocity_gain=damping / stiffness if config.action.mode == "residual_ff" else 0.0,
        needs_reference=mode == "residual_ff",
        meaning=ACTION_MEANINGS[mode],
    )


def add_metadata(path: Path, text: str) -> None:
    """Put metadata into an ONNX model."""
    import onnx

    model = onnx.load(path)
    onnx.helper.set_model_props(model, {METADATA_KEY: text})
    onnx.checker.check_model(model)
    onnx.save(model, path)
