"""From trajectories of a dataset to the pictures of a video."""

import math
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.motion import Motion
from kine2go_warp.errors import RenderError
from kine2go_warp.files import atomic_file
from kine2go_warp.renders.camera import FollowCamera, Pose
from kine2go_warp.renders.captions import caption
from kine2go_warp.renders.encoding import check_ending, possible_rate, write_video
from kine2go_warp.renders.process import Picture, RenderProcess, RenderRequest

POSE_ARRAYS = ("root_position", "root_orientation", "joint_position")
SHOWN_ARRAYS = (*POSE_ARRAYS, *(f"reference_{name}" for name in POSE_ARRAYS))
"""Row arrays that are drawn."""

SMALLEST, LARGEST = 64, 4096
"""Limits of the sides of a picture [pixels]."""
SMALLEST_TILE = 48
"""Least side of the part of a picture that one trajectory has [pixels]."""


@dataclass(frozen=True)
class RenderConfig:
    """How a video looks."""

    width: int = 640
    """Of the whole picture [pixels]."""
    height: int = 480
    """Of the whole picture [pixels]."""
    fps: float = 30.0
    """Pictures a second [Hz]; videos run at the speed of the robot."""
    start: float = 0.0
    """From the first row [s]."""
    end: float | None = None
    """From the first row [s]; by default the end of the longest trajectory."""
    columns: int | None = None
    """Trajectories side by side; by default as many as below each other."""
    reference: bool = True
    """Whether the reference is drawn, too."""
    meshes: Path | None = None
    """Folder of the user's meshes of trunk and legs; by default the robot is drawn as ``robots.look`` has it."""

    def __post_init__(self) -> None:
        for name, value in (("width", self.width), ("height", self.height)):
            if not SMALLEST <= value <= LARGEST or value % 2:
                raise RenderError(f"the {name} must be an even number from {SMALLEST} to {LARGEST}, not {value}")
        if not 1.0 <= self.fps <= 240.0:
            raise RenderError(f"fps must be between 1 and 240, not {self.fps:g}")
        if not 0.0 <= self.start < math.inf or (self.end is not None and not self.start < self.end):
            raise RenderError(f"a video begins at 0 s or later and ends after that, not {self.start:g} to {self.end}")
        if self.columns is not None and self.columns < 1:
            raise RenderError(f"a grid needs at least one column, not {self.columns}")


@dataclass(frozen=True)
class RenderedTrajectory:
    """One trajectory, ready to be drawn."""

    motion: str
    index: int
    rows: dict[str, NDArray[Any]]
    """``SHOWN_ARRAYS``, each of shape [num_rows, ...]."""
    time: NDArray[np.float64]
    """From the first row [s], shape [num_rows]."""
    camera: FollowCamera
    level: bool
    """Whether the ground is level at height zero; other ground is not drawn."""
    robot: str
    """Reference of the robot; see ``robots.robot_named``."""

    def row_at(self, time: float) -> int:
        """Return the latest row that is not after an instant [s]; after the end it is the last."""
        return max(int(np.searchsorted(self.time, time + 1e-6, side="right")) - 1, 0)

    def pose(self, row: int, prefix: str = "") -> Pose:
        """Return the robot's pose, or the reference's with the prefix ``reference_``."""
        return Pose(*(self.rows[prefix + name][row] for name in POSE_ARRAYS))

    def request(self, row: int, reference: bool = True) -> RenderRequest:
        """Return the picture of a row."""
        return RenderRequest(self.pose(row), self.pose(row, "reference_"), self.camera.view(row), reference, self.level)


def read_trajectories(motion: Motion, indices: Sequence[int]) -> list[RenderedTrajectory]:
    """Read trajectories of a motion, in the order of ``indices``.

    Raises:
        RenderError: there is no such trajectory, it is empty, or its poses are not finite.
        DatasetError: an array is missing or cannot be read.
    """
    references = motion.references()
    where = f"{motion.path}/{motion.name}"
    for index in indices:
        if not 0 <= index < len(references):
            last = len(references) - 1
            known = f"trajectories 0 to {last}" if references else "no trajectories"
            raise RenderError(f"{where}: no trajectory {index}; it has {known}")
    wanted = [references[index] for index in sorted(set(indices))]
    trajectories = {}
    for one in motion.read(wanted, SHOWN_ARRAYS):
        if one.length < 1:
            raise RenderError(f"{where}: trajectory {one.index} is empty")
        for name, values in one.arrays.items():
            if not np.isfinite(values).all():
                raise RenderError(
                    f"{where}: {name} of trajectory {one.index} is not finite; see 'kine2go dataset check'"
                )
        time = motion.time[: one.length]
        rate = 1.0 / float(time[1] - time[0]) if len(time) > 1 else 60.0
        path = one.arrays["root_position"], one.arrays["root_orientation"]
        camera = FollowCamera.of(*path, rate, motion.robot.size)
        level, robot = is_level(motion.attributes), motion.robot.reference
        trajectories[one.index] = RenderedTrajectory(
            motion.name, one.index, one.arrays, time - time[0], camera, level, robot
        )
    return [trajectories[index] for index in indices]


def is_level(attributes: dict[str, Any]) -> bool:
    """Return whether a motion was simulated on level ground, as far as its attributes tell."""
    settings: Any = attributes
    for name in ("training_settings", "env", "terrain"):
        settings = settings.get(name, {}) if isinstance(settings, dict) else {}
    return not isinstance(settings, dict) or settings.get("kind", "flat") == "flat"


@dataclass(frozen=True)
class VideoRecord:
    """What was written."""

    pictures: int
    fps: float
    """[Hz]; may differ from what was asked for in a GIF."""


def render_video(
    dataset: Path,
    motion: str,
    trajectories: Sequence[int],
    path: Path,
    config: RenderConfig,
    advanced: Callable[[int, int], None] | None = None,
    overwrite: bool = False,
) -> VideoRecord:
    """Write a video of one trajectory, or of several side by side.

    Args:
        dataset: Folder of the dataset.
        motion: Name of the motion.
        trajectories: Places of the trajectories in the motion, at least one.
        path: File to write, ``.mp4`` or ``.gif``.
        config: How it looks.
        advanced: Called after each picture with the number of pictures done and that of all.
        overwrite: Whether a file that is there may be replaced.

    Raises:
        RenderError: something asked for is not there or makes no sense, or this machine cannot draw.
        DatasetError: the dataset cannot be read.
    """
    check_ending(path)
    check_output(path, overwrite)
    shown = read_trajectories(open_dataset(dataset).motion(motion), trajectories)
    fps = possible_rate(path, config.fps)
    instants = video_instants(shown, config, fps)
    tile_sizes(len(shown), config)

    def counted(pictures: Iterator[Picture]) -> Iterator[Picture]:
        for number, picture in enumerate(pictures):
            yield picture
            if advanced is not None:
                advanced(number + 1, len(instants))

    # Closed at once when something fails, so that the process that draws ends, too.
    with atomic_file(path) as temporary, closing(video_pictures(shown, instants, config)) as pictures:
        write_video(counted(pictures), temporary, fps)
    return VideoRecord(len(instants), fps)


def check_output(path: Path, overwrite: bool) -> None:
    """Check that a file can be written, before the work begins.

    Raises:
        RenderError: something is in the way, or there is no such folder.
    """
    if not path.parent.is_dir():
        raise RenderError(f"{path.parent}: no such folder; create it, or choose another")
    if path.is_dir():
        raise RenderError(f"{path}: is a folder; name a file")
    if path.exists() and not overwrite:
        raise RenderError(f"{path}: exists; choose another name, or replace it with --overwrite")


def video_instants(trajectories: Sequence[RenderedTrajectory], config: RenderConfig, fps: float) -> NDArray[np.float64]:
    """Return the instants that are shown, from the first row [s].

    Raises:
        RenderError: the trajectories end before the video begins.
    """
    longest = max(float(trajectory.time[-1]) for trajectory in trajectories)
    if config.start > longest:
        raise RenderError(f"the video begins at {config.start:g} s, and the trajectories end at {longest:.3g} s")
    end = longest if config.end is None else min(config.end, longest)
    return config.start + np.arange(math.floor((end - config.start) * fps + 1e-6) + 1) / fps


def tile_sizes(count: int, config: RenderConfig) -> tuple[int, int, int]:
    """Return the columns of a grid of ``count`` trajectories, and width and height of each one's part [pixels].

    Raises:
        RenderError: there are too many to be told apart.
    """
    columns = min(config.columns or math.ceil(math.sqrt(count)), count)
    width, height = config.width // columns, config.height // math.ceil(count / columns)
    if min(width, height) < SMALLEST_TILE:
        raise RenderError(
            f"{count} trajectories in {columns} columns leave {width}x{height} pixels for each, and it takes "
            f"{SMALLEST_TILE}; choose fewer, other --columns or a larger --size"
        )
    return columns, width, height


def video_pictures(
    trajectories: Sequence[RenderedTrajectory], instants: NDArray[np.float64], config: RenderConfig
) -> Generator[Picture, None, None]:
    """Draw the pictures of a video, each of shape [height, width, 3]."""
    columns, width, height = tile_sizes(len(trajectories), config)
    with RenderProcess(width, height, trajectories[0].robot, config.meshes) as renderer:
        for instant in instants:
            picture = np.full((config.height, config.width, 3), 235, np.uint8)
            for place, trajectory in enumerate(trajectories):
                row = trajectory.row_at(float(instant))
                tile = caption(
                    renderer.draw(trajectory.request(row, config.reference)),
                    make_captions(trajectory, row, float(instant)),
                )
                top, left = place // columns * height, place % columns * width
                picture[top : top + height, left : left + width] = tile
            yield picture


def make_captions(trajectory: RenderedTrajectory, row: int, instant: float) -> tuple[str, str]:
    """Return what is written into a picture: whose it is, and which row."""
    ended = "  (ended)" if instant > trajectory.time[-1] + 1e-6 else ""
    ground = "" if trajectory.level else "  (ground not drawn)"
    return f"{trajectory.motion}  #{trajectory.index}{ground}", f"row {row}  {trajectory.time[row]:.3f} s{ended}"
