"""The recording of a reference clip over some cycles, to look at before any training."""

from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.recordings.layout import curves, scene, turned, whole
from kine2go_warp.recordings.meshes import Meshes
from kine2go_warp.recordings.robot import EYE, FOLLOWED, RobotDrawer
from kine2go_warp.recordings.shapes import Poses, compute_poses
from kine2go_warp.recordings.stream import LEG_COLOURS, THIN, Colour, Columns, recording_file
from kine2go_warp.robots import RobotSpec
from kine2go_warp.robots.spec import LEG_JOINTS

CYCLES = 3
ROOT_COLOUR: Colour = (225, 228, 235)
SEAM_COLOUR: Colour = (232, 76, 160)
KEYPOINT_COLOUR: Colour = (150, 235, 150)
BONE_COLOUR: Colour = (50, 165, 80)
ASIDE = (0.0, -0.5, 0.0)
"""How far beside the robot the source's keypoints are drawn, to its right where it begins [m]."""


def record_clip(clip: MotionClip, path: Path, cycles: int = CYCLES, meshes: Meshes | None = None) -> None:
    """Write a recording of a clip: the robot over some cycles, or once, where its feet go and stand, and the seams.

    The seam is where one cycle ends and the next begins: marks on the root's path and on the curves.
    """
    cycles = cycles if clip.cycle is not None else 1
    spec, num_rows = clip.spec, cycles * clip.num_frames
    motion = clip.extended(0, num_rows - clip.num_frames)
    assert motion.joints is not None
    poses = compute_poses(spec, motion.root_position, motion.root_orientation, motion.joints)
    time = np.arange(num_rows, dtype=np.float64) * clip.frame_duration
    standing = np.tile(clip.stance > 0.5, (cycles, 1))
    seams = np.arange(clip.num_frames, num_rows, clip.num_frames)
    with recording_file(clip.name, clip.content_hash(), path) as recording:
        recording.send_blueprint(clip_layout(clip.name, poses, motion.root_orientation[0], spec))
        columns = Columns(recording, "clip", time)
        RobotDrawer(spec, meshes).draw(columns.below("robot"), poses, standing)
        log_ways(columns, poses, standing, seams)
        log_keypoints(columns, clip, cycles)
        log_stances(columns, standing, spec)
        log_joints(columns, motion.joints, spec)
        columns.curves("plots/residual", 1e3 * np.tile(clip.residual, cycles)[:, None], ["residual"], [ROOT_COLOUR])
        log_seams(recording, time[seams])
        columns.fix("text", rr.TextDocument(clip_text(clip, cycles), media_type="text/markdown"))


def log_ways(columns: Columns, poses: Poses, standing: NDArray[np.bool_], seams: NDArray[Any]) -> None:
    """Log the ways of root and feet, the places where feet stand, and the seams."""
    columns.fix("ways/root", rr.LineStrips3D([poses.root_position], colors=[ROOT_COLOUR], radii=THIN))
    for foot, (leg, colour) in enumerate(LEG_COLOURS.items()):
        way = poses.feet[:, foot]
        columns.fix(f"ways/{leg}", rr.LineStrips3D([way], colors=[[*colour, 150]], radii=THIN))
        columns.fix(f"ways/{leg}_stance", rr.Points3D(way[standing[:, foot]], colors=[colour], radii=0.008))
    columns.fix("ways/seams", rr.Points3D(poses.root_position[seams], colors=[SEAM_COLOUR], radii=0.025))


def log_keypoints(columns: Columns, clip: MotionClip, cycles: int) -> None:
    """Log the source's keypoints, if the clip has them, as points joined by bones.

    They are logged where they belong, and a transform of their own, which a user may clear, shifts them aside.
    """
    if clip.keypoints is None:
        return
    points = clip.keypoints.over_cycles(clip.cycle, cycles).astype(np.float32)
    bones = points[:, np.array(clip.keypoints.bones, dtype=int)]
    count, num_bones = len(clip.keypoints.names), len(clip.keypoints.bones)
    names = [name.replace("_", " ") for name in clip.keypoints.names]
    columns.fix("keypoints", rr.Transform3D(translation=ASIDE))
    style = rr.Points3D.from_fields(
        radii=[0.013] * count, colors=[KEYPOINT_COLOUR] * count, labels=names, show_labels=False
    )
    columns.fix("keypoints/points", style)
    columns.send("keypoints/points", rr.Points3D.columns(positions=points.reshape(-1, 3)), count)
    columns.fix("keypoints/bones", rr.LineStrips3D.from_fields(colors=[BONE_COLOUR] * num_bones, radii=[0.006]))
    columns.send("keypoints/bones", rr.LineStrips3D.columns(strips=bones.reshape(-1, 2, 3)), num_bones)


def log_stances(columns: Columns, standing: NDArray[np.bool_], spec: RobotSpec) -> None:
    """Log a bar for each foot, which is there while it stands, the first leg on top."""
    rows = np.arange(len(spec.legs), 0, -1)
    bars = np.where(standing, rows, np.nan)
    names = [leg.name for leg in spec.legs]
    columns.curves("plots/stance/bars", bars, names, LEG_COLOURS.values(), width=9.0)
    # Without these the ends of the axis would follow the bars.
    columns.curves("plots/stance/range", np.tile([0.4, 4.6], (len(bars), 1)), ["", ""], [(0, 0, 0, 0)] * 2)


def log_joints(columns: Columns, joints: NDArray[Any], spec: RobotSpec) -> None:
    """Log the joint positions of each leg."""
    for number, leg in enumerate(spec.legs):
        part = joints[:, 3 * number : 3 * number + 3]
        columns.curves(f"plots/joints/{leg.name}", part, LEG_JOINTS, list(LEG_COLOURS.values())[:3])


def log_seams(recording: rr.RecordingStream, times: NDArray[Any]) -> None:
    """Log a mark at each seam."""
    marks = Columns(recording, "clip/plots", times)
    style = rr.SeriesPoints(colors=[list(SEAM_COLOUR)], names=["seam"], markers=["diamond"], marker_sizes=[7.0])
    marks.fix("seam", style)
    marks.send("seam", rr.Scalars.columns(scalars=np.zeros(len(times))))


def clip_text(clip: MotionClip, cycles: int) -> str:
    """Return what is known of a clip, in Markdown."""
    origin = clip.origin
    x, y, yaw = clip.displacement
    distance = float(np.hypot(x, y))
    facts = {
        "period": f"{clip.period:.3f} s, {clip.num_frames} frames",
        "kind": clip.kind,
        "it leads": f"{distance:.3f} m, {yaw:.3f} rad",
        "mean speed": f"{distance / clip.period:.2f} m/s",
        "time scale": f"{clip.time_scale:g}, slowed by {clip.slow_down:g}",
        "largest residual": f"{1e3 * clip.residual.max():.2f} mm",
        "source": f"{origin.source}, frames {origin.start} to {origin.end} at {origin.source_rate:g} Hz",
        "licence": origin.licence,
    }
    shares = [f"{leg}: {share:.0%}" for leg, share in zip(LEG_COLOURS, (clip.stance > 0.5).mean(axis=0), strict=True)]
    facts["standing"] = ", ".join(shares)
    seen = f"{cycles} cycles; pink marks are the seams between them." if clip.kind == "cycle" else "Played once."
    if clip.keypoints is not None:
        seen += " Green: the source's keypoints, in the robot's size, half a metre aside."
    lines = [f"### {clip.name}", seen, "", "| | |", "|---|---|"]
    return "\n".join([*lines, *(f"| {name} | {value} |" for name, value in facts.items())])


def clip_layout(name: str, poses: Poses, orientation: NDArray[Any], spec: RobotSpec) -> rrb.Blueprint:
    """Return the layout of a clip's recording."""
    start = poses.root_position[0]
    space = [f"+ /clip/{part}/**" for part in ("robot", "keypoints", "ways")]
    eye = tuple(start + turned(EYE, orientation))
    joints = [curves(f"{leg.name} joints [rad]", "clip/plots", [f"joints/{leg.name}", "seam"]) for leg in spec.legs]
    plots = rrb.Vertical(
        curves("stance", "clip/plots", ["stance/bars", "stance/range", "seam"]),
        rrb.Tabs(*joints),
        curves("farthest foot from its target [mm]", "clip/plots", ["residual", "seam"]),
        rrb.TextDocumentView(name="clip", origin="clip/text"),
        row_shares=[3, 3, 2, 3],
    )
    view = scene(name, "/clip", space, eye, tuple(start), f"/clip/robot/{FOLLOWED}")
    return whole(rrb.Horizontal(view, plots, column_shares=[3, 2], name=name))
