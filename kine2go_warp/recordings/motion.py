"""The recording of a motion: its trajectories, the most doubtful ones first, on one timeline."""

from dataclasses import dataclass
from pathlib import Path

import rerun as rr

from kine2go_warp.dataset.doubt import Doubt, doubt_of, filter_limits
from kine2go_warp.dataset.motion import Motion, Trajectory
from kine2go_warp.dataset.verdicts import Verdict, standing_verdicts
from kine2go_warp.errors import DatasetError
from kine2go_warp.recordings.layout import motion_layout
from kine2go_warp.recordings.meshes import Meshes
from kine2go_warp.recordings.robot import RobotDrawer
from kine2go_warp.recordings.stream import recording_file
from kine2go_warp.recordings.summary import motion_text
from kine2go_warp.recordings.trajectory import log_trajectory


@dataclass(frozen=True)
class Style:
    """What a recording shows."""

    trajectories: int | None = None
    """How many, the most doubtful ones; by default all."""
    meshes: Meshes | None = None
    """Drawn instead of primitive shapes."""


def record_motion(motion: Motion, path: Path, style: Style = Style()) -> int:
    """Write a recording of a motion and return how many trajectories it shows.

    Raises:
        DatasetError: the motion holds no trajectory, or an array cannot be read.
    """
    shown = most_doubtful(motion, style.trajectories)
    if not shown:
        raise DatasetError(f"motion '{motion.name}' holds no trajectory to record")
    verdicts = {index: verdict_text(one) for index, one in standing_verdicts(motion).items()}
    spec = motion.robot
    drawer = RobotDrawer(spec, style.meshes)
    doubts = [doubt for _, doubt in shown]
    with recording_file(motion.name, motion.attributes.get("fingerprint", ""), path) as recording:
        recording.send_blueprint(motion_layout(motion.name, shown, spec))
        text = motion_text(motion, doubts, verdicts)
        recording.log("list", rr.TextDocument(text, media_type="text/markdown"), static=True)
        for one, doubt in shown:
            log_trajectory(recording, motion, one, doubt, drawer, verdicts.get(one.index, ""))
    return len(shown)


def most_doubtful(motion: Motion, count: int | None) -> list[tuple[Trajectory, Doubt]]:
    """Return trajectories of a motion in memory, the most doubtful ones first."""
    limits = filter_limits(motion.attributes)
    references = [one for one in motion.references() if one.length > 0]
    known = [(one, doubt_of(one, limits)) for one in motion.read(references, None)]
    known.sort(key=lambda pair: -pair[1].value)
    return known[:count]


def verdict_text(verdict: Verdict) -> str:
    """Return a verdict in words."""
    why = f": {verdict.why}" if verdict.why else ""
    return f"{verdict.verdict} by {verdict.who}{why}"
