"""From a motion file to the clip that the simulation tracks."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.body import fit_height, lowest_body_point, ramp_frames, smooth_root, smooth_shift
from kine2go_warp.motions.catalogue import CatalogueEntry
from kine2go_warp.motions.clip import ClipOrigin, MotionClip, assemble_clip
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.motions.cycle import (
    CycleStep,
    PoseSequence,
    close_cycle,
    extend_cyclically,
    recentred,
    with_extrapolated_frame,
)
from kine2go_warp.motions.cycle_search import best_cycle, seam_score
from kine2go_warp.motions.inverse_kinematics import InverseKinematics, RobotTrajectory
from kine2go_warp.motions.keypoints import KeypointMotion
from kine2go_warp.motions.skeleton import Skeleton, skeleton_at
from kine2go_warp.motions.stance import detect_stance, hold_feet
from kine2go_warp.motions.targets import PoseTargets, pose_targets, reach_remarks, standing_height
from kine2go_warp.robots import RobotSpec
from kine2go_warp.rotations import heading, turn_planar, wrap_angle

Array = NDArray[np.float64]

MARGIN_TIME = 1.0
"""A cycle is continued by itself, but by this at least, on either side while it is cleaned, so that no stance is cut
and filters see no ends [s]."""
SOLVED_MARGIN = 0.25
"""How far beyond the cycle joints are solved for [s]."""
RATE_TOLERANCE = 0.01
"""How far a file's rate may be from the catalogue's, relatively."""
FLOOR_PASSES = 3
"""How often the base is raised until no part of the body is below the floor."""


@dataclass(frozen=True)
class SelectedRange:
    """The frames of a motion that become one cycle."""

    name: str
    targets: PoseTargets
    """The frames, and the one after them unless the file ends."""
    open_ended: bool
    """Whether the file ends with the range, so that the frame after it is missing."""
    frame_duration: float
    """[s]"""
    origin: ClipOrigin


@dataclass(frozen=True)
class Retargeted:
    """A clip and what it was made of, to judge it by."""

    clip: MotionClip
    source_path_length: float
    """Length of the base's path in the ground plane according to the source, scaled [m]."""
    seam_score: float
    """Distance between first frame and the one after the last in the source, in standard deviations of the motion; NaN
    where the file ends with the range."""
    remarks: tuple[str, ...] = ()
    """What was repaired in the file, and whether the feet reach the floor."""


def retarget(
    entry: CatalogueEntry, data_folder: Path | None, solver: InverseKinematics, config: RetargetConfig
) -> Retargeted:
    """Retarget one catalogue entry.

    The range of T frames becomes a cycle of T frames; the frame after the range, if the file has one, tells where the
    next cycle begins.

    Raises:
        ClipError: the file or the range cannot be used.
        CatalogueError: the file is not bundled and no data folder is given.
    """
    source = entry.motion_source
    path = entry.path(data_folder)
    motion = source.load(path, entry.rate)
    if abs(motion.rate / entry.rate - 1.0) > RATE_TOLERANCE:
        raise ClipError(f"{path}: runs at {motion.rate:.1f} Hz, but the catalogue says {entry.rate:g} Hz")
    start, end = entry.frames.resolve(motion.num_frames, str(path))
    targets = pose_targets(motion, source, solver.spec)
    if config.mode == "contact" and config.search_frames > 0:
        start, end = best_cycle(targets, start, end, config.search_frames)
    selected = SelectedRange(
        name=entry.name,
        targets=targets.frames(start, min(end + 1, motion.num_frames)),
        open_ended=end == motion.num_frames,
        frame_duration=1.0 / motion.rate,
        origin=entry.origin(path, start, end, motion.rate),
    )
    make = retarget_contacts if config.mode == "contact" else retarget_plain
    clip = make(selected, solver, config)
    clip = replace(clip, keypoints=keypoints_of(clip, motion.scaled(source.scale), targets, start, end))
    steps = np.linalg.norm(np.diff(selected.targets.root_position[:, :2], axis=0), axis=1)
    score = seam_score(targets, start, end) if end < motion.num_frames else float("nan")
    remarks = motion.remarks + reach_remarks(clip.foot_position[..., 2] - solver.spec.foot_radius)
    return Retargeted(clip, float(steps.sum()), score, remarks)


def keypoints_of(clip: MotionClip, motion: KeypointMotion, targets: PoseTargets, start: int, end: int) -> Skeleton:
    """Return the source's keypoints from ``start`` to ``end``, in the world frame of the clip made from them.

    Args:
        clip: The clip.
        motion: The whole motion in the robot's size.
        targets: What it asks for.
        start: First frame of the clip.
        end: The frame after its last.
    """
    wanted = targets.frames(start, end)
    source_root = wanted.root_position, wanted.root_orientation
    floor = float(standing_height(motion).mean())
    return skeleton_at(motion.frames(start, end), floor, source_root, (clip.root_position, clip.root_orientation))


def retarget_plain(selected: SelectedRange, solver: InverseKinematics, config: RetargetConfig) -> MotionClip:
    """Follow the paper's rule: inverse kinematics frame by frame, then a blended seam in joint space."""
    targets = selected.targets
    solved = solver.solve(targets)
    poses = PoseSequence(solved.root_position, solved.root_orientation, solved.joint_position)
    if selected.open_ended:
        poses = with_extrapolated_frame(poses)
    closed, cycle = close_cycle(recentred(poses), config.blend_frames)
    feet = targets.foot_position - np.array([0.0, 0.0, solver.spec.foot_radius])
    num_frames = len(closed.root_position)
    stance = detect_stance(feet, targets.root_position, selected.frame_duration, config)[:num_frames].astype(float)
    residual = solved.residual[:num_frames]
    return assemble_clip(
        selected.name,
        selected.frame_duration,
        closed.root_position,
        closed.root_orientation,
        closed.channels,
        stance,
        residual,
        cycle,
        selected.origin,
        solver.spec,
    )


def retarget_contacts(selected: SelectedRange, solver: InverseKinematics, config: RetargetConfig) -> MotionClip:
    """Close the cycle in task space, hold standing feet, fit the base, and only then solve for the joints.

    All of it is done on the cycle continued on both sides, so that what comes out in the middle is periodic.
    """
    targets, frame_duration = selected.targets, selected.frame_duration
    poses = PoseSequence(targets.root_position, targets.root_orientation, feet_in_heading_frame(targets))
    if selected.open_ended:
        poses = with_extrapolated_frame(poses)
    closed, cycle = close_cycle(recentred(poses), config.blend_frames)
    num_frames = len(closed.root_position)
    margin = max(num_frames, round(MARGIN_TIME / frame_duration))
    longer = extend_cyclically(closed.root_position, closed.root_orientation, closed.channels, cycle, margin, margin)
    feet = feet_in_world(longer)
    feet[..., 2] -= solver.spec.foot_radius
    stance = detect_stance(feet, longer.root_position, frame_duration, config)
    feet = hold_feet(feet, stance, config)
    feet[..., 2] += solver.spec.foot_radius
    position, orientation = smooth_root(
        longer.root_position, longer.root_orientation, config.smoothing / frame_duration
    )
    position = fit_height(solver.spec, position, orientation, feet, frame_duration, config)
    first = round(SOLVED_MARGIN / frame_duration)
    around = slice(margin - first, margin + num_frames + first)
    solved = solve_above_floor(position[around], orientation[around], feet[around], frame_duration, solver)
    middle = slice(first, first + num_frames)
    centred = recentred(
        PoseSequence(solved.root_position[middle], solved.root_orientation[middle], solved.joint_position[middle])
    )
    step = cycle_between(solved, first, num_frames)
    clip = assemble_clip(
        selected.name,
        frame_duration,
        centred.root_position,
        centred.root_orientation,
        centred.channels,
        stance[margin : margin + num_frames].astype(float),
        solved.residual[middle],
        step,
        selected.origin,
        solver.spec,
    )
    return slowed_to_motors(clip, solver.spec)


def feet_in_heading_frame(targets: PoseTargets) -> Array:
    """Return the feet relative to the root's place in the plane, in its heading; heights over the floor stay.

    Shape [num_frames, 12].
    """
    offset = targets.foot_position - targets.root_position[:, None] * np.array([1.0, 1.0, 0.0])
    return turn_planar(offset, -heading(targets.root_orientation)[:, None]).reshape(len(offset), 12)


def feet_in_world(poses: PoseSequence) -> Array:
    """Undo ``feet_in_heading_frame``: foot centres in the world [m], shape [num_frames, 4, 3]."""
    feet = turn_planar(poses.channels.reshape(-1, 4, 3), heading(poses.root_orientation)[:, None])
    return feet + poses.root_position[:, None] * np.array([1.0, 1.0, 0.0])


def solve_above_floor(
    position: Array, orientation: Array, feet: Array, frame_duration: float, solver: InverseKinematics
) -> RobotTrajectory:
    """Solve for the joints, raising the base where trunk, head or knees would be below the floor."""
    time = np.arange(len(position), dtype=np.float64) * frame_duration
    solved = solver.solve(PoseTargets(time, position, orientation, feet))
    for _ in range(FLOOR_PASSES):
        lowest = lowest_body_point(solver.spec, solved.root_position, solved.root_orientation, solved.joint_position)
        if lowest.min() >= 0.0:
            break
        position = position.copy()
        position[:, 2] += smooth_shift(np.maximum(-lowest, 0.0) * 1.05, ramp_frames(frame_duration))
        solved = solver.solve(PoseTargets(time, position, orientation, feet))
    return solved


def cycle_between(solved: RobotTrajectory, first: int, num_frames: int) -> CycleStep:
    """Return the displacement from a frame to the one a cycle later, as seen from the former."""
    ends = [first, first + num_frames]
    yaw = heading(solved.root_orientation[ends])
    offset = turn_planar(solved.root_position[ends[1]] - solved.root_position[ends[0]], -yaw[0])
    return CycleStep(float(offset[0]), float(offset[1]), float(wrap_angle(yaw[1] - yaw[0])))


def slowed_to_motors(clip: MotionClip, spec: RobotSpec) -> MotionClip:
    """Return the clip, slowed by the smallest factor that keeps every joint within its motor's speed."""
    factor = float((np.abs(clip.joint_velocity) / np.array(spec.joint_speed)).max())
    if factor <= 1.0:
        return clip
    return assemble_clip(
        clip.name,
        clip.frame_duration * factor,
        clip.root_position,
        clip.root_orientation,
        clip.joint_position,
        clip.stance,
        clip.residual,
        clip.cycle,
        clip.origin,
        spec,
        factor,
    )
