"""Motion clips on the device."""

from collections.abc import Sequence

import numpy as np
import warp as wp

from kine2go_warp.env.terrain import FLAT
from kine2go_warp.errors import ClipError
from kine2go_warp.kernels.reference import Placement, ReferenceClips, ReferenceState
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.motions.cycle import CycleStep


def upload_clips(clips: Sequence[MotionClip], control_duration: float, device: wp.Device) -> ReferenceClips:  # pyright: ignore[reportGeneralTypeIssues] - a Warp struct
    """Pack clips one after another on a device.

    Args:
        clips: At least one clip.
        control_duration: Duration of a control step [s].
        device: Where to.
    """
    if not clips:
        raise ClipError("an environment needs at least one clip")

    def packed(field: str) -> np.ndarray:
        return np.concatenate([getattr(clip, field) for clip in clips]).astype(np.float32)

    lengths = np.array([clip.num_frames for clip in clips])
    cycles = [CycleStep(0.0, 0.0, 0.0) if clip.cycle is None else clip.cycle for clip in clips]
    steps = [[cycle.x, cycle.y] for cycle in cycles]
    reference = ReferenceClips()
    reference.root_position = wp.array(packed("root_position"), dtype=wp.vec3, device=device)
    reference.root_orientation = wp.array(packed("root_orientation")[:, [1, 2, 3, 0]], dtype=wp.quat, device=device)
    reference.root_linear_velocity = wp.array(packed("root_linear_velocity"), dtype=wp.vec3, device=device)
    reference.root_angular_velocity = wp.array(packed("root_angular_velocity"), dtype=wp.vec3, device=device)
    reference.joint_position = wp.array(packed("joint_position"), dtype=float, device=device)
    reference.joint_velocity = wp.array(packed("joint_velocity"), dtype=float, device=device)
    reference.body_rests = wp.array(packed("body_may_touch").astype(np.int32), dtype=int, device=device)
    reference.first_frame = wp.array(np.cumsum(lengths) - lengths, dtype=int, device=device)
    reference.num_frames = wp.array(lengths, dtype=int, device=device)
    reference.span = wp.array([clip.span for clip in clips], dtype=int, device=device)
    reference.frames_per_step = wp.array(
        [control_duration / clip.frame_duration for clip in clips], dtype=float, device=device
    )
    reference.cycle_translation = wp.array(np.array(steps, dtype=np.float32), dtype=wp.vec2, device=device)
    reference.cycle_yaw = wp.array([cycle.yaw for cycle in cycles], dtype=float, device=device)
    return reference


def replace_clips(reference: ReferenceClips, clips: Sequence[MotionClip], control_duration: float) -> None:  # pyright: ignore[reportGeneralTypeIssues] - a Warp struct
    """Replace packed clips by as many others with the same frames, where captured graphs read them.

    Args:
        reference: What ``upload_clips`` has returned.
        clips: The others.
        control_duration: Duration of a control step [s].
    """
    others = upload_clips(clips, control_duration, reference.root_position.device)
    for name in ReferenceClips.vars:
        wp.copy(getattr(reference, name), getattr(others, name))


def make_placement(num_worlds: int, device: wp.Device) -> Placement:  # pyright: ignore[reportGeneralTypeIssues] - a Warp struct
    """Return the place of the reference in each world: clip 0 from its beginning, unturned, on level ground."""
    placement = Placement()
    placement.terrain = FLAT.upload(device)
    placement.clip = wp.zeros(num_worlds, dtype=int, device=device)
    placement.start_phase = wp.zeros(num_worlds, dtype=float, device=device)
    placement.heading = wp.zeros(num_worlds, dtype=float, device=device)
    placement.origin = wp.zeros(num_worlds, dtype=wp.vec2, device=device)
    return placement


def make_reference_state(num_worlds: int, device: wp.Device) -> ReferenceState:  # pyright: ignore[reportGeneralTypeIssues] - a Warp struct
    """Return buffers for the reference at one instant."""
    reference = ReferenceState()
    reference.root = wp.zeros(num_worlds, dtype=wp.transform, device=device)
    reference.linear_velocity = wp.zeros(num_worlds, dtype=wp.vec3, device=device)
    reference.angular_velocity = wp.zeros(num_worlds, dtype=wp.vec3, device=device)
    reference.joint_position = wp.zeros((num_worlds, 12), dtype=float, device=device)
    reference.joint_velocity = wp.zeros((num_worlds, 12), dtype=float, device=device)
    reference.body_rests = wp.zeros(num_worlds, dtype=int, device=device)
    return reference
