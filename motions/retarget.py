"""From a motion file to the clip that the simulation tracks."""

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.body import (
    GRAVITY,
    above_floor,
    fit_height,
    fly,
    leg_reach,
    rolled,
    smooth_root,
)
from kine2go_warp.motions.body_contact import resting_ends, settle, side_by_side
from kine2go_warp.motions.catalogue_entry import CatalogueEntry
from kine2go_warp.motions.clip import ClipOrigin, Kind, MotionClip, assemble_clip
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.motions.cycle import CycleStep, close_cycle, continued, cycle_between, extend
from kine2go_warp.motions.cycle_search import best_cycle, seam_score
from kine2go_warp.motions.fidelity import measure
from kine2go_warp.motions.inverse_kinematics import InverseKinematics
from kine2go_warp.motions.keypoints import KeypointMotion
from kine2go_warp.motions.poses import Poses
from kine2go_warp.motions.sequence import Played, animal_of, joined
from kine2go_warp.motions.skeleton import Skeleton, skeleton_at
from kine2go_warp.motions.stance import detect_stance, hold_feet, longest_stance, stand_feet, without_short_runs
from kine2go_warp.motions.targets import pose_targets, reach_remarks, standing_height
from kine2go_warp.motions.validation import check_ends
from kine2go_warp.motions.variation import mirror_image
from kine2go_warp.robots import RobotSpec

Array = NDArray[np.float64]

MARGIN_TIME = 1.0
"""A cycle is continued by this and by its longest stance on either side while it is cleaned, so that no stance is cut
and filters see no ends [s]."""
SOLVED_MARGIN = 0.25
"""How far beyond the cycle joints are solved for [s]."""
RATE_TOLERANCE = 0.01
"""How far a file's rate may be from the catalogue's, relatively."""
CONTEXT = 1.0
"""How far beyond the range stances are looked for, so that none is cut [s]; a motion played once is held so long."""
ROLLING_PASSES = 2
"""How often the rolling of the feet is worked out from the legs that follow from it."""
SLOWING_PASSES = 5
"""How often the flights of a motion that motors slow are worked out."""
LARGEST_DIP = 0.01
"""How far the base may be pulled down before a foothold is moved instead [m]."""


@dataclass(frozen=True)
class SelectedRange:
    """The frames of a motion that become one clip."""

    name: str
    kind: Kind
    """Whether they become a cycle, or begin and end at rest."""
    targets: Poses
    """With feet: the frames of the clip and the two after them, extrapolated where the file ends."""
    stance: NDArray[np.bool_]
    """Whether the animal's feet stand, for the frames of the clip, shape [num_frames, 4]."""
    rests: NDArray[np.bool_]
    """Whether its front and its rear rest on the floor, shape [num_frames, 2]."""
    frame_duration: float
    """Of the source [s]."""
    time_scale: float
    """Duration of the clip over that of the source."""
    origin: ClipOrigin

    @property
    def num_frames(self) -> int:
        """Frames of the clip."""
        return len(self.stance)


@dataclass(frozen=True)
class Retargeted:
    """A clip and what it was made of, to judge it by."""

    clip: MotionClip
    source_path_length: float
    """Length of the base's path in the ground plane according to the source, scaled and smoothed [m]."""
    seam_score: float
    """Distance between first frame and the one after the last in the source, in standard deviations of the motion; NaN
    where the file ends with the range."""
    foot_moved: float
    """Largest distance by which a foot was moved for its leg to reach it [m]."""
    remarks: tuple[str, ...] = ()
    """What was repaired in the file, and whether the feet reach the floor."""


def retarget(
    entry: CatalogueEntry, data_folder: Path | None, solver: InverseKinematics, config: RetargetConfig
) -> Retargeted:
    """Retarget one catalogue entry.

    The range of T frames becomes a cycle of T frames; the frame after the range, if the file has one, tells where the
    next cycle begins. A motion that is played once is slowed to rest at its ends, which are held
    (``KeypointMotion.played_once``).

    Raises:
        ClipError: the file or the range cannot be used.
        CatalogueError: the file is not bundled and no data folder is given.
    """
    if entry.members:
        return join(entry, data_folder, solver, config)
    source = entry.motion_source
    path = entry.path(data_folder)
    motion = source.load(path, entry.rate or None)
    if entry.rate and abs(motion.rate / entry.rate - 1.0) > RATE_TOLERANCE:
        raise ClipError(f"{path}: runs at {motion.rate:.1f} Hz, but the catalogue says {entry.rate:g} Hz")
    config = replace(config, mode=entry.mode or config.mode, time_scale=entry.time_scale or config.time_scale)
    start, end = entry.frames.resolve(motion.num_frames, str(path))
    scale = source.proportions(solver.spec).scale
    scaled = motion.scaled(scale)
    standing = standing_height(scaled)
    origin = entry.origin(path, start, end, motion.rate)
    if entry.kind == "once":
        hold = config.hold if entry.hold is None else entry.hold
        motion = motion.played_once(start, end, hold, config.slow_down_time, CONTEXT)
        scaled, start = motion.scaled(scale), round(CONTEXT * motion.rate)
        end = motion.num_frames - start
    targets = pose_targets(motion, source, solver.spec, standing)
    if config.mode == "contact" and entry.kind == "cycle":
        start, end = best_cycle(targets, start, end, round(config.search_time * motion.rate))
        origin = replace(origin, start=start, end=end)
    time_scale = scale**0.5 if config.time_scale == "froude" else config.time_scale
    near, stance = select(targets, scaled.points("toe"), (start, end), 1.0 / motion.rate, solver.spec, config)
    rests = resting_ends(scaled, float(standing.mean()))[start:end]
    selected = SelectedRange(entry.name, entry.kind, near, stance, rests, 1.0 / origin.source_rate, time_scale, origin)
    make = retarget_contacts if config.mode == "contact" else retarget_plain
    clip, moved = make(selected, solver, config)
    keypoints = keypoints_of(clip, scaled, float(standing.mean()), targets, start, end)
    clip = replace(clip, keypoints=keypoints, fidelity=measure(clip, scaled, solver.spec, (start, end)))
    steps = np.linalg.norm(np.diff(selected.targets.root_position[: end - start + 1, :2], axis=0), axis=1)
    has_score = entry.kind == "cycle" and end < motion.num_frames
    score = seam_score(targets, start, end) if has_score else float("nan")
    heights = clip.foot_position[..., 2] - solver.spec.foot_radius
    remarks = motion.remarks + entry.file_remarks(origin.sha256) + reach_remarks(heights)
    if entry.mirrored:
        clip = mirror_image(clip).completed(solver.spec)
    check_ends(clip, path)
    return Retargeted(clip, float(steps.sum()), score, moved, remarks)


def join(
    entry: CatalogueEntry, data_folder: Path | None, solver: InverseKinematics, config: RetargetConfig
) -> Retargeted:
    """Retarget the parts of a sequence and join them to one clip that is played once.

    Raises:
        ClipError: a file or a range of a part cannot be used.
        CatalogueError: a file is not bundled and no data folder is given.
    """
    spec, found = solver.spec, [retarget(member, data_folder, solver, config) for member in entry.members]
    parts = [Played.of(one.clip, part) for one, part in zip(found, entry.parts, strict=True)]
    step = min(part.clip.frame_duration for part in parts)
    hold = config.hold if entry.hold is None else entry.hold
    track = joined(parts, spec, step, round(hold / step), 2 * round(0.5 * config.slow_down_time / step))
    poses = track.poses()
    digest = hashlib.sha256("".join(part.clip.content_hash() for part in parts).encode()).hexdigest()
    names = " + ".join(part.name for part in entry.parts)
    origin = ClipOrigin("sequence", names, digest, 0, len(track), 1.0 / step, entry.licence, entry.citation)
    selected = SelectedRange(entry.name, "once", poses, track.stance > 0.5, track.rests > 0.5, step, 1.0, origin)
    # The parts have their pace and their flights already.
    clip, moved = retarget_contacts(selected, solver, replace(config, time_scale=1.0))
    animal = animal_of(poses, spec, step)
    roots = (poses.root_position, poses.root_orientation), (clip.root_position, clip.root_orientation)
    clip = replace(clip, keypoints=skeleton_at(animal, 0.0, *roots), fidelity=measure(clip, animal, spec))
    length = float(np.linalg.norm(np.diff(poses.root_position[:, :2], axis=0), axis=1).sum())
    remarks = tuple(f"{one.clip.name}: {remark}" for one in found for remark in one.remarks)
    return Retargeted(clip, length, float("nan"), moved, remarks)


def select(
    targets: Poses, toes: Array, frames: tuple[int, int], step: float, spec: RobotSpec, config: RetargetConfig
) -> tuple[Poses, NDArray[np.bool_]]:
    """Cut a range out of a motion, its base smoothed and its stances detected with what lies around it.

    The animal's toes tell when a foot stands: the robot's feet are farther apart, so that a turn moves them.

    Returns:
        ``SelectedRange.targets`` and ``SelectedRange.stance``.
    """
    start, end = frames
    context = round(CONTEXT / step)
    first = max(start - context, 0)
    near = targets.frames(first, end + context)
    assert near.feet is not None
    heights = near.feet[..., 2:] - spec.foot_radius
    planar = toes[first : first + len(near), :, :2]
    stance = detect_stance(np.concatenate([planar, heights], axis=-1), step, config)
    if config.mode == "contact":
        position, orientation = smooth_root(near.root_position, near.root_orientation, config.smoothing / step)
        near = replace(near, root_position=position, root_orientation=orientation)
    chosen = near.frames(start - first, end + 2 - first)
    chosen = chosen.extrapolated(end - start + 2 - len(chosen))
    return chosen, stance[start - first : end - first]


def keypoints_of(
    clip: MotionClip, motion: KeypointMotion, floor: float, targets: Poses, start: int, end: int
) -> Skeleton:
    """Return the source's keypoints from ``start`` to ``end``, in the world frame of the clip made from them.

    Args:
        clip: The clip.
        motion: The whole motion in the robot's size.
        floor: Height of its floor [m].
        targets: What it asks for.
        start: First frame of the clip.
        end: The frame after its last.
    """
    wanted = targets.frames(start, end)
    source_root = wanted.root_position, wanted.root_orientation
    return skeleton_at(motion.frames(start, end), floor, source_root, (clip.root_position, clip.root_orientation))


def retarget_plain(
    selected: SelectedRange, solver: InverseKinematics, config: RetargetConfig
) -> tuple[MotionClip, float]:
    """Follow the paper's rule: inverse kinematics frame by frame, then a blended seam in joint space."""
    solved, residual = solver.solve(selected.targets)
    closed, cycle = closed_at_ends(selected, solved, config)
    return clip_of(selected, closed, selected.stance, residual[: selected.num_frames], cycle, solver.spec), 0.0


def retarget_contacts(
    selected: SelectedRange, solver: InverseKinematics, config: RetargetConfig
) -> tuple[MotionClip, float]:
    """Retarget with feet that hold, at a speed that the motors reach.

    Flights take the time that gravity gives them, so where motors slow a motion with flights they are worked out again.

    Returns the clip, and by how far a foot was moved for its leg to reach it at most [m].
    """
    slow_down = 1.0
    for _ in range(SLOWING_PASSES):
        clip, moved = retarget_at_speed(selected, solver, config, slow_down)
        kept = slowed_to_motors(clip, solver.spec)
        if config.time_scale != "froude" or kept is clip:
            break
        slow_down = kept.slow_down
    return kept, moved


def retarget_at_speed(
    selected: SelectedRange, solver: InverseKinematics, config: RetargetConfig, slow_down: float
) -> tuple[MotionClip, float]:
    """Close a cycle in task space, hold standing feet, fit the base, and only then solve for the joints.

    All of it is done on the clip continued on both sides, so that what comes out in the middle is periodic, or at rest
    at its ends.
    """
    frame_duration, num_frames = selected.frame_duration, selected.num_frames
    closed, cycle = closed_at_ends(selected, selected.targets, config)
    margin = round(MARGIN_TIME / frame_duration) + longest_stance(selected.stance)
    longer = extend(closed, cycle, margin, margin)
    played = continued(np.arange(-margin, num_frames + margin), num_frames, cycle is not None)
    stance, rests = without_short_runs(selected.stance[played], frame_duration), selected.rests[played]
    fitting = (solver.spec, frame_duration, config.knee_margin)
    wanted = side_by_side(longer, stance, rests) if rests.any() else longer
    near = settle(wanted, rests, *fitting) if rests.any() else wanted
    longer, stance, moved = stand(near, stance, solver.spec, config)
    if config.time_scale == "froude":
        fall = GRAVITY * (selected.time_scale * slow_down * frame_duration) ** 2
        longer, wanted = (fly(one, stance, fall, frame_duration) for one in (longer, wanted))
    if rests.any():
        # Feet that roll with other legs than at first leave the base another place.
        longer = settle(replace(wanted, feet=longer.feet), rests, *fitting)
    else:
        longer = fit_height(solver.spec, longer, frame_duration, config)
    first = round(SOLVED_MARGIN / frame_duration)
    around = longer.frames(margin - first, margin + num_frames + first)
    solved, residual = solver.solve(above_floor(around, frame_duration, solver.spec))
    middle = slice(first, first + num_frames)
    step = None if cycle is None else cycle_between(solved, first, num_frames)
    poses = solved.frames(middle.start, middle.stop).recentred()
    clip = clip_of(selected, poses, stance[margin : margin + num_frames], residual[middle], step, solver.spec)
    return slowed(clip, slow_down, solver.spec), float(moved[margin : margin + num_frames].max())


def closed_at_ends(selected: SelectedRange, poses: Poses, config: RetargetConfig) -> tuple[Poses, CycleStep | None]:
    """Return the poses of a clip, recentred, and where its cycle leads; what is played once needs no closing."""
    if selected.kind == "once":
        return poses.frames(0, selected.num_frames).recentred(), None
    return close_cycle(poses, selected.num_frames, config.blend_time / selected.frame_duration)


def clip_of(
    selected: SelectedRange,
    poses: Poses,
    stance: NDArray[np.bool_],
    residual: Array,
    cycle: CycleStep | None,
    spec: RobotSpec,
) -> MotionClip:
    """Return the clip of a range."""
    return assemble_clip(
        poses,
        spec,
        name=selected.name,
        frame_duration=selected.frame_duration * selected.time_scale,
        stance=stance.astype(float),
        body_rests=selected.rests.astype(float),
        residual=residual,
        cycle=cycle,
        origin=selected.origin,
        time_scale=selected.time_scale,
    )


def stand(
    poses: Poses, stance: NDArray[np.bool_], spec: RobotSpec, config: RetargetConfig
) -> tuple[Poses, NDArray[np.bool_], Array]:
    """Return the poses with feet that roll where they stand; which of them stand; how far they were moved to reach."""
    assert poses.feet is not None
    radius = np.array([0.0, 0.0, spec.foot_radius])
    reach = leg_reach(spec, poses.root_position, poses.root_orientation, config.knee_margin, LARGEST_DIP)
    rolling = np.zeros((len(poses), 4, 2))
    for _ in range(ROLLING_PASSES):
        held, *_ = stand_feet(poses.feet - radius, stance, rolling, reach)
        rolling = rolled(spec, replace(poses, feet=held + radius))
    held, kept, moved = hold_feet(poses.feet - radius, stance, rolling, reach, config)
    return replace(poses, feet=held + radius), kept, moved


def slowed_to_motors(clip: MotionClip, spec: RobotSpec) -> MotionClip:
    """Return the clip, slowed by the smallest factor that keeps every joint within its motor's speed."""
    factor = float((np.abs(clip.joint_velocity) / np.array(spec.joint_speed)).max())
    return slowed(clip, factor, spec)


def slowed(clip: MotionClip, factor: float, spec: RobotSpec) -> MotionClip:
    """Return the clip slowed by a factor, itself if that is no more than 1."""
    if factor <= 1.0:
        return clip
    slow_down = factor * clip.slow_down
    return replace(clip, frame_duration=clip.frame_duration * factor, slow_down=slow_down).completed(spec)
