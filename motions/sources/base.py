"""The interface of a source."""

import inspect
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from kine2go_warp.motions.examination import examined
from kine2go_warp.motions.keypoints import KeypointMotion
from kine2go_warp.robots import RobotSpec

STATED = ("name", "scale", "root_drop", "forward_lift", "foot_outward")


@dataclass(frozen=True)
class Proportions:
    """How an animal compares with one robot."""

    scale: float
    """Size of the robot over the size of the animal."""
    root_drop: float
    """See ``MotionSource`` [m]."""
    forward_lift: float
    """See ``MotionSource`` [m]."""
    foot_outward: float
    """See ``MotionSource`` [m]."""


class MotionSource(ABC):
    """Reads one file format and knows how the animal in it compares with the robot.

    A source states ``name``, ``scale`` and the three offsets itself, for the Go2: they belong to one kind of animal.
    ``proportions`` are those for another robot.
    """

    name: str
    """Name used in the catalogue."""
    scale: float
    """Size of the robot over the size of the animal."""
    root_drop: float
    """How far the robot's base lies below the midpoint of pelvis and neck, after scaling [m]."""
    forward_lift: float
    """Height by which the neck lies below the trunk's axis through the pelvis, after scaling [m]."""
    foot_outward: float
    """How far the feet are moved outwards, for the robot's thighs sit beside its hips [m]."""

    def __init_subclass__(cls) -> None:
        """Check that nothing is left out.

        Raises:
            TypeError: a value is missing.
        """
        fields = inspect.get_annotations(cls)
        missing = [name for name in STATED if not hasattr(cls, name) and name not in fields]
        if missing:
            raise TypeError(f"the source {cls.__name__} does not state {', '.join(missing)}")

    unit: str = "metres"
    """Unit of the file's lengths, to name a likelier one."""
    tells_rate: bool = True
    """Whether a file of this source tells its own frame rate."""
    rate: float = 0.0
    """Frame rate of files that do not state one, 0 if it must be told [Hz]."""

    def load(self, path: Path, rate: float | None = None) -> KeypointMotion:
        """Read a whole file, examine it and repair what can be repaired.

        Args:
            path: The file.
            rate: Frames per second of a file that cannot tell its own [Hz].

        Raises:
            ClipError: the file is missing or malformed, or has a fault that cannot be repaired.
        """
        return _loaded(self, path, rate, _state(self.data_file(path)))

    def proportions(self, spec: RobotSpec) -> Proportions:
        """Return how the animal compares with a robot: lengths grow with its legs, ``foot_outward`` with its hips."""
        size = spec.size
        return Proportions(
            size * self.scale, size * self.root_drop, size * self.forward_lift, spec.width * self.foot_outward
        )

    def begins(self, line: str) -> bool:
        """Return whether a text file that begins with this line is likely one of this source's."""
        del line
        return False

    def data_file(self, path: Path) -> Path:
        """Return the file that ``path`` is in, for sources that name one motion among several in a file."""
        return path

    @abstractmethod
    def read(self, path: Path) -> KeypointMotion:
        """Read a whole file as it is.

        Raises:
            ClipError: the file is missing or malformed; the message names file and line.
        """


@lru_cache(maxsize=64)
def _loaded(source: MotionSource, path: Path, rate: float | None, state: tuple[int, int]) -> KeypointMotion:
    """Return what ``load`` does; several motions are in one file, which is read once while it stays as it is."""
    del state
    motion = source.read(path)
    if rate is not None and not source.tells_rate:
        motion = replace(motion, time=np.arange(motion.num_frames) / rate)
    return examined(motion, source.scale, source.unit, str(path))


def _state(file: Path) -> tuple[int, int]:
    """Return what changes when a file is written again; zeros if there is none, which its reader tells."""
    try:
        status = file.stat()
    except OSError:
        return 0, 0
    return status.st_mtime_ns, status.st_size


def forget_files() -> None:
    """Make the next ``load`` of each file read it."""
    _loaded.cache_clear()
