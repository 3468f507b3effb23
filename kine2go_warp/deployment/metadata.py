"""What it takes to drive a robot with an exported policy: read from the bundle's files, and kept inside the models."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from kine2go_warp.errors import PolicyError
from kine2go_warp.robots import MotorLimits
from kine2go_warp.settings import from_dictionary, to_dictionary

FORMAT_VERSION = 3

METADATA_KEY = "kine2go_policy"
"""Under this key the metadata lie in the ONNX model, as JSON text."""
ONNX_FILE = "policy.onnx"
TORCHSCRIPT_FILE = "policy.pt"
TORCHSCRIPT_EXTRA = f"{METADATA_KEY}.json"
"""Name of the extra file in the TorchScript model that holds the same text."""
METADATA_FILE, OBSERVATION_FILE = "deploy.yaml", "observation.json"
"""The same metadata to read, those of the model's input apart. The first makes a folder an exported policy."""
OBSERVATION_FIELDS = ("observation", "history_rule")
"""Fields of the metadata that are in ``OBSERVATION_FILE``."""
INPUT_NAME, OUTPUT_NAME = "observation", "output"

YAML_HEADER = f"""# What it takes to drive a robot with {ONNX_FILE}, whose input {OBSERVATION_FILE} describes.
# Units are in README.md. Both files repeat what {ONNX_FILE} holds inside; kine2go refuses them if they differ from it.
"""

ACTION_MEANINGS = {
    "default_offset": "joint target = default_joint_position + scale * clipped output",
    "residual_ff": "joint target = reference joint position + velocity_gain * reference joint velocity + scale * "
    "clipped output, the reference being that of reference_lead control steps from now: the clip is needed at run time",
    "absolute": "joint target = output, in radians, not clipped",
}
"""How each mode of action becomes a joint target [rad]."""

HISTORY_RULE = (
    "NAME[t-k] is what NAME[t] was k control steps ago; at the beginning of an episode all ages hold the first state, "
    "and last_action is zero. NAME[t+k] is the reference k control steps from now. last_action is the network's own "
    "output, before scale and clip."
)
TORQUE_RULE = (
    "torque = stiffness * (joint target - joint position) - damping * joint velocity, limited to +-torque_limit, or by "
    "motor_limits where they are given, at physics_rate; a joint target rules from latency after the observation that "
    "it was computed from."
)


@dataclass(frozen=True)
class ObservationRow:
    """One row of the observation table."""

    name: str
    start: int
    stop: int
    unit: str
    description: str


@dataclass(frozen=True)
class JointRow:
    """One row of the joint table."""

    name: str
    policy_index: int
    """Its place in the policy's outputs, in the observation and in every array of the metadata."""
    sdk_index: int
    """Its number in the manufacturer's motor interface."""
    default_position: float
    """[rad]"""
    lower: float
    """[rad]"""
    upper: float
    """[rad]"""
    torque_limit: float
    """[N m]"""


@dataclass(frozen=True)
class ActionRule:
    """How an output becomes joint targets."""

    mode: Literal["default_offset", "residual_ff", "absolute"]
    scale: float
    """Radians for an output of 1."""
    clip: float
    """Outputs are clipped to this magnitude."""
    reference_lead: float
    """Mode ``residual_ff``: how far ahead the reference is taken [control steps]."""
    velocity_gain: float
    """Mode ``residual_ff``: factor on the reference joint velocity [s]."""
    needs_reference: bool
    """Whether joint targets cannot be formed without the clip."""
    meaning: str


@dataclass(frozen=True)
class ReferenceClip:
    """A clip that the policy tracks; the observation needs it, whatever the action is."""

    name: str
    file: str
    """Beside the model."""
    sha256: str
    """Of the file."""
    content_hash: str
    """Of the motion."""
    num_frames: int
    """Frames of a cycle."""
    frame_duration: float
    """[s]"""
    licence: str
    citation: str


@dataclass(frozen=True)
class Parity:
    """Largest difference between the exported models' outputs and the PyTorch policy's."""

    onnx: float
    torchscript: float
    observations: int
    """On how many observations, real and random."""


@dataclass(frozen=True)
class PolicyMetadata:
    """Everything about an exported policy but its weights. Joint arrays are in the order of ``joints``."""

    format_version: int
    software_version: str
    revision: str
    """Commit of the software, where it is known."""
    policy: str
    """Name of the policy folder."""
    iterations: int
    """Iterations of training."""
    checkpoint_sha256: str
    fingerprint: str
    """Hash of clips and settings of the training."""
    robot: str
    robot_model_sha256: str
    """Of the compiled model's numbers."""
    joints: tuple[JointRow, ...]
    stiffness: float
    """Of the PD law [N m/rad]."""
    damping: float
    """Of the PD law [N m s/rad]."""
    torque_rule: str
    control_rate: float
    """[Hz]"""
    physics_rate: float
    """Steps of the training's physics and of its PD law [Hz]."""
    latency: float
    """Time from an observation to the moment when its joint target rules [s]."""
    action: ActionRule
    normaliser: str
    """Where observations are normalised."""
    observation: tuple[ObservationRow, ...]
    history_rule: str
    clips: tuple[ReferenceClip, ...]
    parity: Parity
    motor_limits: MotorLimits | None = None
    """Torque limits by the joint's speed, where the training had them."""
    joint_friction: tuple[float, ...] = ()
    """Coulomb friction of the simulated joints [N m]; a controller need not add it."""

    def __post_init__(self) -> None:
        if [joint.policy_index for joint in self.joints] != list(range(len(self.joints))):
            raise ValueError("joints are not in the order of policy_index")

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The joints in the policy's order."""
        return tuple(joint.name for joint in self.joints)

    @property
    def default_joint_position(self) -> tuple[float, ...]:
        """[rad], shape [12]."""
        return tuple(joint.default_position for joint in self.joints)

    @property
    def torque_limit(self) -> tuple[float, ...]:
        """[N m], shape [12]."""
        return tuple(joint.torque_limit for joint in self.joints)

    @property
    def sdk_index(self) -> tuple[int, ...]:
        """Number of each joint's motor in the manufacturer's interface."""
        return tuple(joint.sdk_index for joint in self.joints)

    @property
    def observation_size(self) -> int:
        """Number of values in an observation."""
        return self.observation[-1].stop

    @property
    def substeps(self) -> int:
        """Physics steps in one control step."""
        return round(self.physics_rate / self.control_rate)

    @property
    def latency_substeps(self) -> int:
        """Latency [physics steps]."""
        return round(self.latency * self.physics_rate)

    def to_json(self) -> str:
        """Return the metadata as JSON text."""
        return json.dumps(to_dictionary(self), indent=1)

    def write(self, folder: Path) -> None:
        """Write the metadata to their two files."""
        import yaml

        values = to_dictionary(self)
        observation = {name: values.pop(name) for name in OBSERVATION_FIELDS}
        (folder / OBSERVATION_FILE).write_text(json.dumps(observation, indent=1) + "\n")
        text = yaml.safe_dump(values, sort_keys=False, default_flow_style=None, width=120, allow_unicode=True)
        (folder / METADATA_FILE).write_text(YAML_HEADER + text)

    @classmethod
    def from_json(cls, text: str, where: str) -> "PolicyMetadata":
        """Read metadata.

        Raises:
            PolicyError: they are damaged or of another format version.
        """
        try:
            values = json.loads(text)
        except ValueError as error:
            raise PolicyError(f"{where}: holds no metadata that can be read ({error})") from None
        return cls.from_values(values, where)

    @classmethod
    def from_values(cls, values: Any, where: str) -> "PolicyMetadata":
        """Return the metadata of what a file holds."""
        version = values.get("format_version") if isinstance(values, dict) else None
        if version is None:
            raise PolicyError(f"{where}: holds no metadata that can be read (no format_version)")
        if version != FORMAT_VERSION:
            raise PolicyError(f"{where}: export format {version}, expected {FORMAT_VERSION}; export the policy again")
        return from_dictionary(cls, values, where, PolicyError)


def read_metadata(folder: Path) -> PolicyMetadata:
    """Read the metadata of an exported policy from their files.

    Raises:
        PolicyError: there are none, or they cannot be read.
    """
    import yaml

    file = folder / METADATA_FILE
    try:
        values = yaml.safe_load(file.read_text())
    except (FileNotFoundError, NotADirectoryError):
        old = " (an export of an older version is; export the policy again)" if (folder / ONNX_FILE).exists() else ""
        raise PolicyError(f"{folder}: no exported policy here{old}; make one with 'kine2go policy export'") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise PolicyError(f"{file}: cannot be read as YAML ({' '.join(str(error).split())})") from None
    observation = folder / OBSERVATION_FILE
    try:
        values = values | {name: json.loads(observation.read_text())[name] for name in OBSERVATION_FIELDS}
    except FileNotFoundError:
        raise PolicyError(f"{observation}: missing; export the policy again") from None
    except (ValueError, KeyError, TypeError) as error:
        raise PolicyError(f"{observation}: cannot be read ({error!r}); export the policy again") from None
    return PolicyMetadata.from_values(values, str(file))
