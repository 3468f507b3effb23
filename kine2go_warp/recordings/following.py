"""A viewer that follows a review: the trajectory in question is what it shows."""

import time

import rerun as rr

from kine2go_warp.dataset.limit_usage import LimitUsage
from kine2go_warp.dataset.motion import Motion
from kine2go_warp.recordings.layout import trajectory_tab, whole
from kine2go_warp.recordings.live import PATIENCE
from kine2go_warp.recordings.meshes import Meshes
from kine2go_warp.recordings.robot import RobotDrawer
from kine2go_warp.recordings.trajectory import log_trajectory


class FollowingViewer:
    """Sends one trajectory after the other to a viewer.

    Each is a recording of its own: the viewer turns to one that begins and plays it from its first row. A layout cannot
    do that, which has neither the time nor the recording to show.
    """

    def __init__(self, address: str, meshes: Meshes | None = None) -> None:
        """Prepare.

        Args:
            address: Where the viewer takes recordings.
            meshes: Drawn instead of our own.
        """
        self.address, self.meshes = address, meshes
        self._drawers: dict[str, RobotDrawer] = {}
        self._shown: rr.RecordingStream | None = None

    def show(self, motion: Motion, usage: LimitUsage) -> None:
        """Show a trajectory."""
        rr.set_strict_mode(True)
        (one,) = motion.read([usage.reference], None)
        spec = motion.robot
        drawer = self._drawers.setdefault(motion.name, RobotDrawer(spec, self.meshes))
        name = f"{motion.name}/{one.index}"
        recording = rr.RecordingStream("kine2go review", recording_id=f"{name} {time.time_ns()}")
        recording.connect_grpc(self.address)
        recording.send_blueprint(whole(trajectory_tab(one, usage, spec)))
        recording.send_recording_name(name)
        recording.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        log_trajectory(recording, motion, one, usage, drawer, "")
        recording.flush(timeout_sec=PATIENCE)
        self.close()
        self._shown = recording

    def close(self) -> None:
        """End; the viewer keeps what it shows."""
        if self._shown is not None:
            self._shown.disconnect()
            self._shown = None
