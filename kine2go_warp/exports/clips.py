"""Clips as motions for other trackers."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from kine2go_warp.errors import ExportError
from kine2go_warp.exports.export import RECORD, check_target, folder_name
from kine2go_warp.exports.motions import MOTION_TARGETS, BodyMotion
from kine2go_warp.files import atomic_folder
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.names import check_distinct
from kine2go_warp.robots.kinematics import link_positions, link_rotations, link_turning
from kine2go_warp.rotations import from_matrices, rotate_by_matrices, to_matrices, turn_planar

STEP = 1e-5
"""Of the central differences by which links move with the joints [s]."""


def clip_motion(clip: MotionClip) -> BodyMotion:
    """Return a clip with all its links, in the world frame."""
    repeats = clip.kind == "cycle"
    clip = closed(clip)
    spec, joints = clip.spec, clip.joint_position
    turn = to_matrices(clip.root_orientation)
    offset = rotate_by_matrices(turn, link_positions(spec, joints))
    ahead = link_positions(spec, joints + STEP * clip.joint_velocity)
    moving = (ahead - link_positions(spec, joints - STEP * clip.joint_velocity)) / (2.0 * STEP)
    turning = clip.root_angular_velocity[:, None]
    own = rotate_by_matrices(turn, link_turning(spec, joints, clip.joint_velocity))
    base = clip.root_linear_velocity[:, None]
    links = {
        "link_position": clip.root_position[:, None] + offset,
        "link_orientation": quaternions(turn[:, None] @ link_rotations(spec, joints)),
        "link_linear_velocity": base + np.cross(turning, offset) + rotate_by_matrices(turn, moving),
        "link_angular_velocity": turning + own,
    }
    names = ("root_position", "root_orientation", "root_linear_velocity", "root_angular_velocity")
    rows = {name: getattr(clip, name) for name in (*names, "joint_position", "joint_velocity")}
    return BodyMotion(
        1.0 / clip.frame_duration,
        repeats,
        {**rows, **links},
        spec.joint_names,
        spec.link_names,
        spec.sdk_motor_order,
    )


def closed(clip: MotionClip) -> MotionClip:
    """Return the poses and velocities of a clip; those of a cycle with the first frame of the next one at the end."""
    if clip.cycle is None:
        return clip
    longer = clip.extended(0, 1)
    assert longer.joints is not None
    yaw = clip.cycle.yaw
    linear, angular, joints = clip.root_linear_velocity, clip.root_angular_velocity, clip.joint_velocity
    return replace(
        clip,
        root_position=longer.root_position,
        root_orientation=longer.root_orientation,
        joint_position=longer.joints,
        root_linear_velocity=np.concatenate([linear, turn_planar(linear[:1], yaw)]),
        root_angular_velocity=np.concatenate([angular, turn_planar(angular[:1], yaw)]),
        joint_velocity=np.concatenate([joints, joints[:1]]),
    )


def quaternions(matrices: np.ndarray) -> np.ndarray:
    """Return sign-continuous quaternions (w, x, y, z), shape [num_frames, num_links, 4], of rotation matrices."""
    return np.stack([from_matrices(matrices[:, link]) for link in range(matrices.shape[1])], axis=1)


def export_clips(clips: Sequence[MotionClip], form: str, out: Path, overwrite: bool = False) -> list[Path]:
    """Write clips as motions, a file each, named after the clips; licences apart as in exports of datasets.

    A cycle is written with the first frame of the next one at its end, as trackers close it.

    Args:
        clips: What to write.
        form: A format of ``MOTION_TARGETS``.
        out: Folder to create.
        overwrite: Replace an older export.

    Returns:
        The files.

    Raises:
        ExportError: there is no such format, two clips have one name, or ``out`` may not be replaced.
    """
    if form not in MOTION_TARGETS:
        raise ExportError(f"'{form}' is no format of motions; known are: {', '.join(MOTION_TARGETS)}")
    names = [clip.name for clip in clips]
    check_distinct(names, ExportError)
    check_target(out, overwrite)
    kind = MOTION_TARGETS[form]
    licences = {clip.origin.licence or "unknown" for clip in clips}
    written = []
    with atomic_folder(out) as folder:
        for clip in clips:
            licence = clip.origin.licence or "unknown"
            path = Path(folder_name(licence) if len(licences) > 1 else ".") / f"{clip.name}{kind.suffix}"
            (folder / path).parent.mkdir(exist_ok=True)
            kind.write(clip_motion(clip), folder / path)
            written.append(path)
        origins = "".join(
            f"- `{clip.name}`: {clip.origin.licence or 'unknown'}. {clip.origin.citation}\n" for clip in clips
        )
        text = f"# {kind.target.title}\n\n{kind.target.time_rule}\n\n## Licences and citations\n\n{origins}"
        (folder / "README.md").write_text(text)
        record = {"format": form, "clips": names, "files": [path.as_posix() for path in written]}
        (folder / RECORD).write_text(json.dumps(record, indent=1))
    return [out / path for path in written]
