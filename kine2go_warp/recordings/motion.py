"""One recording of a motion: the robot, its reference, contacts, joints and errors."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray
from rerun.urdf import UrdfTree

from kine2go_warp.dataset.quality import rotation_angle
from kine2go_warp.dataset.reader import MotionData
from kine2go_warp.errors import DatasetError
from kine2go_warp.files import atomic_file
from kine2go_warp.robots import GO2, RobotSpec
from kine2go_warp.robots.spec import LEG_JOINTS, UrdfReader

PAUSE = 0.5
"""Gap between two trajectories on the timeline [s]."""

REFERENCE_COLOUR = (60, 200, 120, 70)
PLOT_REFERENCE_COLOUR = (150, 150, 150)
CONTACT_COLOUR = (255, 140, 0)
CONTACT_THRESHOLD = 5.0
"""A foot that bears more than this is drawn as standing [N]."""

SHAPES = {"box": rr.Boxes3D, "cylinder": rr.Cylinders3D, "sphere": rr.Ellipsoids3D}
"""What the primitive shapes of a URDF become in Rerun."""

LEG_COLOURS = {"FL": (225, 87, 89), "FR": (78, 121, 167), "RL": (242, 142, 43), "RR": (118, 183, 178)}


@dataclass(frozen=True)
class Track:
    """Several trajectories one after another."""

    time: NDArray[np.float64]
    """[s], shape [num_rows]."""
    rows: dict[str, NDArray]
    """Arrays of ``ROW_ARRAYS``, each of shape [num_rows, ...]."""
    starts: list[tuple[float, str]]
    """When each trajectory begins [s], and what it is called."""


def record_motion(data: MotionData, path: Path, trajectories: int = 3, spec: RobotSpec = GO2) -> None:
    """Write a recording of the first trajectories of a motion, one after another on the timeline ``time``.

    Raises:
        DatasetError: the motion holds no trajectory.
    """
    track = joined_track(data, trajectories)
    recording = rr.RecordingStream("kine2go", recording_id=f"{data.name}-{data.attributes.get('fingerprint', '')}")
    # Through memory, since the library's own file writer only logs an error when the disk is full.
    memory = recording.memory_recording()
    with recording:
        recording.send_blueprint(blueprint(data.name, spec))
        log_robot(recording, track, spec, "robot", "root", "joint_position", None)
        log_robot(recording, track, spec, "reference", "reference_root", "reference_joint_position", REFERENCE_COLOUR)
        log_path(recording, track)
        log_contacts(recording, track, spec)
        log_plots(recording, track, spec)
        for start, name in track.starts:
            recording.set_time("time", duration=start)
            recording.log("trajectory", rr.TextLog(name))
    with atomic_file(path) as temporary:
        temporary.write_bytes(memory.drain_as_bytes() or b"")


def joined_track(data: MotionData, trajectories: int) -> Track:
    """Lay trajectories one after another in time, without their padding."""
    lengths = data.trajectories.draws["length"][:trajectories]
    if len(lengths) == 0:
        raise DatasetError(f"motion '{data.name}' holds no trajectory to record")
    times, starts, begin = [], [], 0.0
    for index, length in enumerate(lengths):
        times.append(data.time[:length] + begin)
        starts.append((begin, f"trajectory {index}"))
        begin = float(times[-1][-1]) + PAUSE
    rows = {
        name: np.concatenate([values[index, :length] for index, length in enumerate(lengths)])
        for name, values in data.trajectories.rows.items()
    }
    return Track(np.concatenate(times), rows, starts)


def log_robot(
    recording: rr.RecordingStream,
    track: Track,
    spec: RobotSpec,
    name: str,
    root: str,
    joints: str,
    colour: tuple[int, int, int, int] | None,
) -> None:
    """Log a robot and its motion, in one column a joint."""
    tree = UrdfTree.from_file_path(
        spec.urdf, name, frame_prefix=f"{name}/", static_transform_entity_path=f"transforms/{name}/static"
    )
    tree.log_urdf_to_recording(recording)
    paint_robot(recording, tree, spec, colour)
    index = [rr.TimeColumn("time", duration=track.time)]
    recording.send_columns(
        f"transforms/{name}/root",
        index,
        rr.Transform3D.columns(
            translation=track.rows[f"{root}_position"],
            quaternion=track.rows[f"{root}_orientation"][:, [1, 2, 3, 0]],
            parent_frame=["world"] * len(track.time),
            child_frame=[f"{name}/{spec.base_link}"] * len(track.time),
        ),
    )
    for column, joint_name in enumerate(spec.joint_names):
        joint = tree.get_joint_by_name(joint_name)
        if joint is None:
            raise DatasetError(f"{spec.urdf}: no joint {joint_name}")
        values = track.rows[joints][:, column].astype(float).tolist()
        recording.send_columns(
            f"transforms/{name}/{joint_name}", index, joint.compute_transform_columns(values, clamp=False)
        )


def paint_robot(
    recording: rr.RecordingStream, tree: UrdfTree, spec: RobotSpec, colour: tuple[int, int, int, int] | None
) -> None:
    """Make a robot's shapes solid, in the colours of its URDF or all in one."""
    reader = UrdfReader(spec.urdf)
    for name in [link.attrib["name"] for link in reader.root.findall("link")]:
        link = tree.get_link_by_name(name)
        for entity in tree.get_visual_geometry_paths(link) if link else ():
            visual = f"link[@name='{name}']/visual[@name='{entity.rpartition('/')[2]}']"
            shape = SHAPES[reader.find(f"{visual}/geometry")[0].tag]
            material = reader.find(f"{visual}/material").attrib["name"]
            own = [float(part) for part in reader.find(f"material[@name='{material}']/color").attrib["rgba"].split()]
            paint = shape.from_fields(colors=[colour or own], fill_mode="solid")
            recording.log(entity, paint, static=True)


def log_path(recording: rr.RecordingStream, track: Track) -> None:
    """Log the ways of root and reference, and the floor's frame."""
    recording.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    recording.log("path", rr.CoordinateFrame("world"), static=True)
    starts = np.searchsorted(track.time, [start for start, _ in track.starts])
    for name, colour in (("root_position", (150, 150, 160)), ("reference_root_position", REFERENCE_COLOUR[:3])):
        strips = [strip[::3] for strip in np.split(track.rows[name], starts[1:])]
        recording.log(f"path/{name}", rr.CoordinateFrame("world"), static=True)
        recording.log(f"path/{name}", rr.LineStrips3D(strips, colors=[colour], radii=0.004), static=True)


def log_contacts(recording: rr.RecordingStream, track: Track, spec: RobotSpec) -> None:
    """Log a mark under each foot that stands, and the force on it."""
    index = [rr.TimeColumn("time", duration=track.time)]
    for foot, leg in enumerate(spec.legs):
        force = np.linalg.norm(track.rows["foot_contact_force"][:, foot], axis=-1)
        position = track.rows["link_position"][:, 12 + foot]
        entity = f"contacts/{leg.name}"
        recording.log(entity, rr.CoordinateFrame("world"), static=True)
        recording.send_columns(
            entity,
            index,
            rr.Points3D.columns(
                positions=position,
                radii=np.where(force > CONTACT_THRESHOLD, 0.035, 0.0),
                colors=np.tile(CONTACT_COLOUR, (len(force), 1)),
            ),
        )
        log_scalar(recording, track, f"plots/contact_force/{leg.name}", force, LEG_COLOURS[leg.name])


def log_plots(recording: rr.RecordingStream, track: Track, spec: RobotSpec) -> None:
    """Log joint positions beside their references, and the tracking errors."""
    rows = track.rows
    for column, joint in enumerate(spec.joint_names):
        entity = f"plots/joints/{joint.removesuffix('_joint')}"
        log_scalar(recording, track, entity, rows["joint_position"][:, column], LEG_COLOURS[joint[:2]])
        log_scalar(
            recording, track, f"{entity}_reference", rows["reference_joint_position"][:, column], PLOT_REFERENCE_COLOUR
        )
    joint_error = np.sqrt(np.mean((rows["joint_position"] - rows["reference_joint_position"]) ** 2, axis=-1))
    root_error = np.linalg.norm(rows["root_position"] - rows["reference_root_position"], axis=-1)
    angle = rotation_angle(rows["root_orientation"], rows["reference_root_orientation"])
    log_scalar(recording, track, "plots/errors/joints_rad", joint_error, (225, 87, 89))
    log_scalar(recording, track, "plots/errors/root_m", root_error, (78, 121, 167))
    log_scalar(recording, track, "plots/errors/root_rad", angle, (242, 142, 43))


def log_scalar(
    recording: rr.RecordingStream, track: Track, entity: str, values: NDArray, colour: tuple[int, ...]
) -> None:
    """Log one curve."""
    label = entity.rpartition("/")[2]
    recording.log(entity, rr.SeriesLines(colors=[colour], names=[label]), static=True)
    recording.send_columns(
        entity, [rr.TimeColumn("time", duration=track.time)], rr.Scalars.columns(scalars=values.astype(float))
    )


def blueprint(motion: str, spec: RobotSpec) -> rrb.Blueprint:
    """Return how the viewer is laid out: the scene on the left, plots on the right."""
    robot = f"/robot/{spec.name}"
    scene = rrb.Spatial3DView(
        name=motion,
        origin="/",
        contents=[
            *(f"+ /{part}/**" for part in ("robot", "reference", "transforms", "contacts", "path")),
            *(f"- /{part}/{spec.name}/collision_geometries/**" for part in ("robot", "reference")),
        ],
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=(0.9, -1.0, 0.55),
            tracking_entity=f"{robot}/visual_geometries/{spec.base_link}/base_box_visual",
        ),
        background=rrb.Background(color=(28, 30, 36)),
        spatial_information=rrb.SpatialInformation(target_frame="world"),
    )
    plots = rrb.Vertical(
        rrb.TimeSeriesView(name="errors", origin="plots/errors"),
        rrb.Tabs(*[leg_view(leg.name) for leg in spec.legs], name="joints"),
        rrb.TimeSeriesView(name="contact force [N]", origin="plots/contact_force"),
    )
    return rrb.Blueprint(
        rrb.Horizontal(scene, plots, column_shares=[3, 2]),
        rrb.TimePanel(timeline="time", state="collapsed"),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
    )


def leg_view(leg: str) -> rrb.TimeSeriesView:
    """Return the plot of one leg's joints."""
    suffixes = ("", "_reference")
    parts = [f"/plots/joints/{leg}_{joint}{suffix}" for joint in LEG_JOINTS for suffix in suffixes]
    return rrb.TimeSeriesView(name=f"{leg} joints [rad]", origin="/", contents=[f"+ {part}" for part in parts])
