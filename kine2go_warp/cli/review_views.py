"""What shows the trajectory in question while a person goes through a dataset: a viewer, pictures, or a film."""

import shutil
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from kine2go_warp.cli.texts import say
from kine2go_warp.dataset.limit_usage import LimitUsage
from kine2go_warp.dataset.motion import Motion
from kine2go_warp.errors import Kine2GoError

if TYPE_CHECKING:
    from kine2go_warp.recordings.following import FollowingViewer
    from kine2go_warp.recordings.meshes import Meshes

WIDEST = 160
"""Columns that a picture in the terminal takes at most."""


class Views:
    """Shows trajectories. A view that fails is reported once and then left out; the review goes on without it."""

    def __init__(self, viewer: "FollowingViewer | None" = None, sheets: Path | None = None) -> None:
        """Prepare.

        Args:
            viewer: Follows the questions.
            sheets: Folder of contact sheets.
        """
        self.viewer, self.sheets = viewer, sheets
        self._stack = ExitStack()
        self._renderers = {}

    def show(self, motion: Motion, usage: LimitUsage) -> None:
        """Show a trajectory in each of the views."""
        if self.viewer is not None:
            self.viewer.show(motion, usage)
        if self.sheets is not None:
            self._draw(self.sheets, motion, usage.reference.index)

    def film(self, motion: Motion, usage: LimitUsage) -> Path:
        """Write a film of a trajectory beside the dataset, or into the folder of sheets, and return where it is.

        Raises:
            RenderError: this machine cannot draw.
        """
        from kine2go_warp.renders.video import RenderConfig, render_video

        small = RenderConfig(width=320, height=240, fps=15.0)

        folder = self.sheets or motion.path.resolve().parent / "recordings"
        path = folder / f"{motion.name}-{usage.reference.index:03d}.mp4"
        path.parent.mkdir(parents=True, exist_ok=True)
        render_video(motion.path, motion.name, (usage.reference.index,), path, small, None, overwrite=True)
        return path

    def close(self) -> None:
        """End what draws and shows."""
        self._stack.close()
        if self.viewer is not None:
            self.viewer.close()

    def _draw(self, folder: Path, motion: Motion, index: int) -> None:
        """Draw a contact sheet, and show it in a terminal."""
        from kine2go_warp.renders.process import RenderProcess
        from kine2go_warp.renders.sheet import HEIGHT, WIDTH, draw_sheet, half_blocks

        path = folder / f"{motion.name}-{index:03d}.png"
        robot = motion.robot.reference
        try:
            if robot not in self._renderers:
                self._renderers[robot] = self._stack.enter_context(RenderProcess(WIDTH, HEIGHT, robot))
            sheet = draw_sheet(self._renderers[robot], motion, index, path)
        except Kine2GoError as error:
            say(f"no pictures: {error}")
            self.sheets = None
            return
        if sys.stdout.isatty():
            print(half_blocks(sheet, min(shutil.get_terminal_size().columns, WIDEST)))
        say(f"  pictures: {path}")


@contextmanager
def shown_in(
    web: bool, window: bool, port: int | None, meshes: "Meshes | None", sheets: Path | None
) -> Iterator[Views]:
    """Yield what shows trajectories until the block ends.

    Args:
        web: Serve the viewer to browsers.
        window: Open the viewer.
        port: Where it listens; by default a free port.
        meshes: Drawn instead of our own.
        sheets: Folder of contact sheets.

    Raises:
        RecordingError: the viewer does not start.
    """
    with ExitStack() as stack:
        viewer = None
        if web or window:
            from kine2go_warp.recordings.following import FollowingViewer
            from kine2go_warp.recordings.viewer import WebViewer, open_waiting

            if web:
                server = WebViewer.start([], port)
                stack.callback(server.stop)
                say(f"open {server.url}: it shows the trajectory in question")
                viewer = FollowingViewer(server.source, meshes)
            else:
                viewer = FollowingViewer(open_waiting(port), meshes)
        views = Views(viewer, sheets)
        stack.callback(views.close)
        yield views
