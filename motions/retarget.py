"""From a motion file to the clip that the simulation tracks."""

from pathlib import Path

from kine2go_warp.motions.catalogue import CatalogueEntry
from kine2go_warp.motions.clip import MotionClip, assemble_clip
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.motions.cycle import PoseSequence, close_cycle, recentred, with_extrapolated_frame
from kine2go_warp.motions.inverse_kinematics import InverseKinematics
from kine2go_warp.motions.targets import pose_targets


def retarget(
    entry: CatalogueEntry, data_folder: Path | None, solver: InverseKinematics, config: RetargetConfig
) -> MotionClip:
    """Retarget one catalogue entry.

    The range of T frames becomes a cycle of T frames; the frame after the range, if the file has one, tells where the
    next cycle begins.

    Raises:
        ClipError: the file or the range cannot be used.
        CatalogueError: the file is not bundled and no data folder is given.
    """
    source = entry.motion_source
    path = entry.path(data_folder)
    motion = source.read(path)
    start, end = entry.frames.resolve(motion.num_frames, str(path))
    selected = motion.frames(start, min(end + 1, motion.num_frames))
    trajectory = solver.solve(pose_targets(selected, source, solver.spec))
    poses = PoseSequence(trajectory.root_position, trajectory.root_orientation, trajectory.joint_position)
    if end == motion.num_frames:
        poses = with_extrapolated_frame(poses)
    closed, cycle = close_cycle(recentred(poses), config.blend_frames)
    return assemble_clip(
        entry.name,
        1.0 / motion.rate,
        closed.root_position,
        closed.root_orientation,
        closed.joint_position,
        trajectory.residual[: end - start],
        cycle,
        entry.origin(path, start, end, motion.rate),
        solver.spec,
    )
