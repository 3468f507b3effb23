"""An exported policy that turns measured states into joint targets, with NumPy and ONNX Runtime alone."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.deployment.metadata import (
    INPUT_NAME,
    METADATA_FILE,
    METADATA_KEY,
    OBSERVATION_FILE,
    ONNX_FILE,
    OUTPUT_NAME,
    PolicyMetadata,
    read_metadata,
)
from kine2go_warp.deployment.observer import MeasuredState, ObservationBuilder
from kine2go_warp.deployment.reference import PlacedClip, Reference
from kine2go_warp.errors import PolicyError
from kine2go_warp.files import sha256_of
from kine2go_warp.motions.clip import MotionClip


def open_session(path: Path) -> Any:
    """Open an ONNX model on one thread of the CPU.

    Raises:
        PolicyError: it is missing or cannot be read.
    """
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    try:
        return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # noqa: BLE001 - ONNX Runtime raises errors of many kinds
        raise PolicyError(f"{path}: not an ONNX model that can be read ({error.__class__.__name__})") from None


@dataclass(frozen=True)
class ExportedPolicy:
    """What is in the folder of an exported policy."""

    metadata: PolicyMetadata
    session: Any
    """Of ONNX Runtime."""
    clips: tuple[MotionClip, ...]

    @classmethod
    def load(cls, folder: Path) -> "ExportedPolicy":
        """Read model, metadata and clips.

        Raises:
            PolicyError: the folder holds no exported policy, or metadata or clips that are not the model's.
        """
        path = folder / ONNX_FILE
        if not path.is_file():
            raise PolicyError(f"{folder}: no exported policy here; make one with 'kine2go policy export'")
        session = open_session(path)
        text = session.get_modelmeta().custom_metadata_map.get(METADATA_KEY, "")
        metadata = PolicyMetadata.from_json(text, str(path))
        if read_metadata(folder) != metadata:
            raise PolicyError(
                f"{folder / METADATA_FILE} or {OBSERVATION_FILE}: not what {ONNX_FILE} holds; export the policy again"
            )
        for clip in metadata.clips:
            file = folder / clip.file
            if not file.is_file() or sha256_of(file) != clip.sha256:
                raise PolicyError(f"{file}: missing, or not the clip that was exported; export the policy again")
        return cls(metadata, session, tuple(MotionClip.load(folder / clip.file) for clip in metadata.clips))

    def infer(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the outputs of some observations, shapes [num_observations, size] and [num_observations, 12]."""
        return self.session.run([OUTPUT_NAME], {INPUT_NAME: observation})[0]


class TrackingController:
    """Lets one robot track a reference: ``act`` in every control step."""

    def __init__(self, policy: ExportedPolicy, reference: Reference) -> None:
        """Begin an episode at step 0 of the reference."""
        self.policy, self.metadata, self.reference = policy, policy.metadata, reference
        self.observer = ObservationBuilder(self.metadata, reference)
        self.restart()

    def restart(self) -> None:
        """Begin an episode."""
        self.observer.begin()
        self.last_action = np.zeros(len(self.metadata.joints), np.float32)
        self.step = 0

    def act(self, state: MeasuredState) -> NDArray[np.float64]:
        """Return the joint targets that follow from what is measured now [rad], shape [12]."""
        observation = self.observer.observe(state, self.last_action, self.step)
        self.last_action = self.policy.infer(observation[None])[0]
        target = self.joint_target(self.last_action)
        self.step += 1
        return target

    def joint_target(self, output: NDArray[Any]) -> NDArray[np.float64]:
        """Return the joint targets of an output of the present step [rad], shape [12]."""
        action = self.metadata.action
        if action.mode == "absolute":
            return np.asarray(output, np.float64)
        offset = action.scale * np.clip(np.asarray(output, np.float64), -action.clip, action.clip)
        if action.mode == "default_offset":
            return np.array(self.metadata.default_joint_position) + offset
        coming = self.step + action.reference_lead
        feedforward = action.velocity_gain * self.reference.joint_velocity(coming)
        return self.reference.joint_position(coming) + feedforward + offset


class PolicyController(TrackingController):
    """Drives one robot along a clip: ``begin`` an episode, then ``act`` in every control step."""

    reference: PlacedClip

    def __init__(self, policy: ExportedPolicy, clip: int = 0) -> None:
        """Track one of the policy's clips."""
        super().__init__(policy, PlacedClip(policy.clips[clip], policy.metadata.control_rate))

    def begin(self, phase: float, ground: tuple[float, float], turn: float) -> None:
        """Begin an episode; see ``PlacedClip.place``."""
        self.reference.place(phase, ground, turn)
        self.restart()
