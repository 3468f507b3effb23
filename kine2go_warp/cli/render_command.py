"""The command that makes videos of trajectories."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from kine2go_warp.cli.data import DatasetPath
from kine2go_warp.cli.texts import say
from kine2go_warp.errors import RenderError

Positional = tyro.conf.Positional


@dataclass(frozen=True)
class Render:
    """Make a video of one trajectory, or of several side by side: what was recorded, without simulating it again.

    Example: kine2go dataset render runs/demo/dataset.zarr dog_trot 0 --out trot.mp4
    """

    dataset: DatasetPath
    """A dataset made by 'kine2go dataset gather' or 'kine2go run'."""
    motion: Annotated[Positional[str], tyro.conf.arg(metavar="MOTION")]
    """One of its motions."""
    trajectories: Annotated[Positional[tuple[int, ...]], tyro.conf.arg(metavar="[K ...]")] = ()
    """Numbers of trajectories, counted from 0; by default the first."""
    out: Path = field(kw_only=True)
    """File to write, .mp4 or .gif."""
    size: Annotated[str, tyro.conf.arg(metavar="WIDTHxHEIGHT")] = "640x480"
    """Width and height of the whole picture in pixels."""
    fps: float = 30.0
    """Pictures a second; the video runs at the speed of the robot."""
    start: float = 0.0
    """Where the video begins, in seconds from the first row."""
    end: float | None = None
    """Where it ends; by default at the end of the longest trajectory."""
    columns: int | None = None
    """Trajectories side by side; by default the grid is as square as it can be."""
    reference: bool = True
    """Draw the reference as well, green and see-through."""
    meshes: Path | None = None
    """Folder with trunk, hip, thigh and calf as .obj or .stl, drawn instead of the package's own shapes."""
    overwrite: bool = False
    """Replace a file that is there already."""

    def run(self) -> int:
        """Draw with a progress bar and say what was written."""
        from kine2go_warp.cli.progress import bar
        from kine2go_warp.dataset import open_dataset
        from kine2go_warp.renders.video import RenderConfig, render_video

        width, height = parsed_size(self.size)
        config = RenderConfig(width, height, self.fps, self.start, self.end, self.columns, self.reference, self.meshes)
        chosen = self.trajectories or (0,)
        open_dataset(self.dataset).left_out(self.motion)  # a damaged file of verdicts is an error everywhere
        with bar("drawing") as advanced:
            record = render_video(self.dataset, self.motion, chosen, self.out, config, advanced, self.overwrite)
        say(
            f"{self.out}: {record.pictures} pictures of {width}x{height}, {record.pictures / record.fps:.1f} s at "
            f"{record.fps:g} a second, {self.out.stat().st_size / 1e6:.2f} MB"
        )
        return 0


def parsed_size(text: str) -> tuple[int, int]:
    """Return width and height of a size such as ``640x480`` [pixels].

    Raises:
        RenderError: the text is no size.
    """
    width, _, height = text.lower().partition("x")
    if not (width.isascii() and width.isdigit() and height.isascii() and height.isdigit()):
        raise RenderError(f"a size is width x height in pixels, such as 640x480, not '{text}'")
    return int(width), int(height)
