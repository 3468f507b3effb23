"""One trajectory in a recording: robot, reference, targets, contacts, curves and a text."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from kine2go_warp.dataset.limit_usage import ROW_LIMITS, LimitUsage, row_errors
from kine2go_warp.dataset.motion import Motion, Trajectory
from kine2go_warp.metrics import CONTACT_FORCE, FILTER_METRICS
from kine2go_warp.recordings.pushes import log_pushes
from kine2go_warp.recordings.robot import RobotDrawer, flat
from kine2go_warp.recordings.shapes import Poses, reference_poses, robot_poses, skeletons
from kine2go_warp.recordings.stream import LEG_COLOURS, THICK, THIN, Colour, Columns
from kine2go_warp.recordings.summary import trajectory_text
from kine2go_warp.robots import RobotSpec
from kine2go_warp.robots.spec import LEG_JOINTS

STEPS_AHEAD = (1, 2, 10, 30)
"""Targets that are drawn if a motion's attributes do not tell which ones its policy saw, in control steps."""

TARGET_COLOURS: tuple[Colour, ...] = ((30, 130, 60), (50, 165, 80), (90, 200, 110), (150, 235, 150))
"""From the next target to the farthest."""

FORCE_SCALE = 0.002
"""Length of an arrow by its force [m/N]."""

ERROR_COLOURS: tuple[Colour, ...] = ((98, 160, 234), (245, 178, 66), (239, 108, 98))
ERROR_NAMES = ("blue", "orange", "red")
LIMIT_COLOUR: Colour = (200, 60, 60)
TERM_COLOURS: tuple[Colour, ...] = (
    (239, 108, 98), (245, 178, 66), (94, 200, 178), (98, 160, 234), (178, 132, 220), (200, 200, 200),
)  # fmt: skip
TERM_NAMES = ("red", "orange", "green", "blue", "purple", "grey")
LEG_COLOUR_NAMES = ("red", "blue", "orange", "green")
"""What people call these colours and ``LEG_COLOURS``."""

DIMMED = 0.5
"""Brightness of the curve of a reference beside that of the robot."""


def trajectory_entity(index: int) -> str:
    """Return the path of a trajectory's entities."""
    return f"trajectories/{index:03d}"


def log_trajectory(
    recording: rr.RecordingStream, motion: Motion, one: Trajectory, usage: LimitUsage, drawer: RobotDrawer, verdict: str
) -> None:
    """Log all of a trajectory below :func:`trajectory_entity`.

    Args:
        recording: The recording.
        motion: Its motion.
        one: The trajectory with all row arrays.
        usage: How close it came to the limits.
        drawer: Draws the robot.
        verdict: What was said of it, empty if nothing.
    """
    spec, rows = drawer.spec, one.arrays
    columns = Columns(recording, trajectory_entity(one.index), motion.time[: one.length])
    robot, reference = robot_poses(spec, rows), reference_poses(spec, rows)
    force = rows["foot_contact_force"]
    standing = np.linalg.norm(force, axis=-1) > CONTACT_FORCE
    drawer.draw(columns.below("robot"), robot, standing)
    drawer.draw_ghost(columns.below("reference"), reference)
    log_targets(columns, reference, steps_ahead(motion.attributes))
    log_forces(columns, robot, force, standing)
    log_paths(columns, rows)
    log_pushes(columns, rows)
    log_curves(columns, motion, rows, usage, spec)
    text = f"{trajectory_text(motion, one, usage, verdict)}\n\n{colours_text(motion)}"
    columns.fix("text", rr.TextDocument(text, media_type="text/markdown"))


def colours_text(motion: Motion) -> str:
    """Return which curve has which colour, in Markdown."""
    terms = [term.replace("_", " ") for term in motion.labels("term")]
    plots = {
        "errors": [f"{one} {limit.label}" for one, limit in zip(ERROR_NAMES, ROW_LIMITS, strict=True)],
        "joints": [f"{one} {joint}" for one, joint in zip(LEG_COLOUR_NAMES, LEG_JOINTS, strict=False)]
        + ["darker: reference"],
        "rewards": [f"{TERM_NAMES[number % len(TERM_NAMES)]} {term}" for number, term in enumerate(terms)],
        "forces": [f"{one} {leg}" for one, leg in zip(LEG_COLOUR_NAMES, LEG_COLOURS, strict=True)],
    }
    return "\n".join(["| colours | |", "|---|---|", *(f"| {name} | {', '.join(one)} |" for name, one in plots.items())])


def steps_ahead(attributes: Mapping[str, Any]) -> tuple[int, ...]:
    """Return how many control steps ahead the targets lie that the policy of a motion saw."""
    try:
        steps = attributes["training_settings"]["env"]["steps_ahead"]
        known = tuple(int(step) for step in steps)
    except (KeyError, TypeError, ValueError):
        return STEPS_AHEAD
    return known if known and min(known) > 0 else STEPS_AHEAD


def log_targets(columns: Columns, reference: Poses, steps: tuple[int, ...]) -> None:
    """Log future targets: the reference of later rows, one line a side of the robot, from foot over trunk to foot.

    Towards the end of a trajectory there are fewer of them.
    """
    legs = skeletons(reference)[:, :, 1:]
    sides = [np.concatenate([legs[:, front, ::-1], legs[:, rear]], axis=1) for front, rear in ((0, 2), (1, 3))]
    lines = np.stack(sides, axis=1)
    num_rows = len(lines)
    rows, ahead = np.meshgrid(np.arange(num_rows), np.array(steps), indexing="ij")
    exists = rows + ahead < num_rows
    strips = lines[(rows + ahead)[exists]].reshape(-1, *lines.shape[2:])
    shades = [list(TARGET_COLOURS[min(place, 3)]) for place in range(len(steps)) for _ in range(2)]
    columns.fix("targets", rr.LineStrips3D.from_fields(colors=shades, radii=[THICK]))
    columns.send("targets", rr.LineStrips3D.columns(strips=strips), 2 * exists.sum(axis=1))


def log_forces(columns: Columns, robot: Poses, force: NDArray[Any], standing: NDArray[np.bool_]) -> None:
    """Log an arrow for the force of the floor on each foot that stands."""
    legs = list(LEG_COLOURS.values())
    vectors = np.where(standing[..., None], FORCE_SCALE * force, 0.0)
    columns.fix("forces", rr.Arrows3D.from_fields(colors=legs, radii=[0.006]))
    columns.send("forces", rr.Arrows3D.columns(origins=flat(robot.feet), vectors=flat(vectors)), 4)


def log_paths(columns: Columns, rows: Mapping[str, NDArray[Any]]) -> None:
    """Log the ways of root and reference as a whole."""
    for name, colour in (("root", (225, 228, 235)), ("reference_root", (120, 150, 200))):
        strip = rows[f"{name}_position"][::2]
        columns.fix(f"paths/{name}", rr.LineStrips3D([strip], colors=[colour], radii=THIN))


def log_curves(
    columns: Columns, motion: Motion, rows: Mapping[str, NDArray[Any]], usage: LimitUsage, spec: RobotSpec
) -> None:
    """Log joints beside their references, errors as shares of their limits, rewards, forces and leg distance."""
    reference = rows["reference_joint_position"]
    for number, leg in enumerate(spec.legs):
        part = slice(3 * number, 3 * number + 3)
        colours = list(LEG_COLOURS.values())[:3]
        # The reference comes first, so that the robot's curves are drawn over it.
        names = [*(f"{joint} reference" for joint in LEG_JOINTS), *LEG_JOINTS]
        values = np.concatenate([reference[:, part], rows["joint_position"][:, part]], axis=1)
        columns.curves(f"plots/joints/{leg.name}", values, names, [*map(dimmed, colours), *colours])
    log_errors(columns, rows, usage)
    terms = motion.labels("term")
    colours = [TERM_COLOURS[number % len(TERM_COLOURS)] for number in range(len(terms))]
    columns.curves("plots/reward", rows["reward"], [term.replace("_", " ") for term in terms], colours)
    force = np.linalg.norm(rows["foot_contact_force"], axis=-1)
    columns.curves("plots/force", force, LEG_COLOURS, LEG_COLOURS.values())
    log_leg_distance(columns, rows["leg_distance"], usage)


def log_leg_distance(columns: Columns, distance: NDArray[Any], usage: LimitUsage) -> None:
    """Log the least distance of the legs from one another and the trunk, with a line where the filter rejects."""
    curves = {"least distance": (distance, ERROR_COLOURS[0])}
    deepest = dict(zip((one.name for one in FILTER_METRICS), usage.limits, strict=True))["leg_overlap"]
    if not np.isnan(deepest):
        curves["limit"] = (np.full_like(distance, -deepest), LIMIT_COLOUR)
    values, colours = zip(*curves.values(), strict=True)
    columns.curves("plots/leg_distance", np.stack(values, axis=1), curves, colours)


def log_errors(columns: Columns, rows: Mapping[str, NDArray[Any]], usage: LimitUsage) -> None:
    """Log the errors as shares of the limits of the filter, with a line at 1; without limits as they are."""
    errors, limits = row_errors(rows), usage.limits[: len(ROW_LIMITS)]
    is_known = not np.isnan(limits).any()
    if is_known:
        names = [f"{one.label} / {limit:g} {one.unit}" for one, limit in zip(ROW_LIMITS, limits, strict=True)]
        columns.curves("plots/errors", errors / np.array(limits), names, ERROR_COLOURS)
        columns.curves("plots/limit", np.ones((len(errors), 1)), ["limit"], [LIMIT_COLOUR], width=2.0)
    else:
        columns.curves("plots/errors", errors, [f"{one.label} [{one.unit}]" for one in ROW_LIMITS], ERROR_COLOURS)


def dimmed(colour: Colour) -> Colour:
    """Return a colour made darker."""
    return tuple(round(DIMMED * part) for part in colour[:3])
