"""The recording of a motion: its trajectories, those closest to a limit first, on one timeline."""

from dataclasses import dataclass
from pathlib import Path

import rerun as rr

from kine2go_warp.dataset.limit_usage import LimitUsage, filter_limits, limit_usage
from kine2go_warp.dataset.motion import Motion, Trajectory
from kine2go_warp.dataset.reviews import Review, standing_reviews
from kine2go_warp.errors import DatasetError
from kine2go_warp.recordings.layout import motion_layout, trajectory_tab, whole
from kine2go_warp.recordings.meshes import Meshes
from kine2go_warp.recordings.robot import RobotDrawer
from kine2go_warp.recordings.stream import recording_file
from kine2go_warp.recordings.summary import motion_text
from kine2go_warp.recordings.trajectory import log_trajectory


@dataclass(frozen=True)
class Style:
    """What a recording shows."""

    trajectories: int | None = None
    """How many, those closest to a limit; by default all."""
    by: str = ""
    """The metric by whose limit they are ordered; by default the one that each is closest to."""
    meshes: Meshes | None = None
    """Drawn instead of our own."""


def record_motion(motion: Motion, path: Path, style: Style = Style()) -> int:
    """Write a recording of a motion and return how many trajectories it shows.

    Raises:
        DatasetError: the motion holds no trajectory, or an array cannot be read.
    """
    shown = closest_to_limits(motion, style.trajectories, style.by)
    if not shown:
        raise DatasetError(f"motion '{motion.name}' holds no trajectory to record")
    verdicts = {index: review_text(one) for index, one in standing_reviews(motion).items()}
    spec = motion.robot
    drawer = RobotDrawer(spec, style.meshes)
    usages = [usage for _, usage in shown]
    with recording_file(motion.name, motion.attributes.get("fingerprint", ""), path) as recording:
        # A viewer shows nothing before a layout is whole, and reads few messages a frame. So the most doubtful
        # trajectory comes first with a layout of its own, and the layout with all tabs when their data are there.
        recording.send_blueprint(whole(trajectory_tab(*shown[0], spec)))
        for one, usage in shown:
            log_trajectory(recording, motion, one, usage, drawer, verdicts.get(one.index, ""))
            recording.flush()
        text = motion_text(motion, usages, verdicts)
        recording.log("list", rr.TextDocument(text, media_type="text/markdown"), static=True)
        recording.flush()
        recording.send_blueprint(motion_layout(motion.name, shown, spec))
    return len(shown)


def closest_to_limits(motion: Motion, count: int | None, by: str = "") -> list[tuple[Trajectory, LimitUsage]]:
    """Return trajectories of a motion in memory, those closest to a limit first."""
    limits = filter_limits(motion.attributes)
    references = [one for one in motion.references() if one.length > 0]
    known = [(one, limit_usage(one, limits)) for one in motion.read(references, None)]
    known.sort(key=lambda pair: -pair[1].ratio(by))
    return known[:count]


def review_text(review: Review) -> str:
    """Return a review in words."""
    reason = f": {review.reason}" if review.reason else ""
    return f"{review.verdict} by {review.reviewer}{reason}"
