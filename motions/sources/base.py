"""The interface of a source."""

from abc import ABC, abstractmethod
from pathlib import Path
from typing import ClassVar

from kine2go_warp.motions.keypoints import KeypointMotion


class MotionSource(ABC):
    """Reads one file format and knows how the animal in it compares with the robot.

    A source states ``name``, ``scale`` and the three offsets itself: they belong to one kind of animal.
    """

    name: ClassVar[str]
    """Name used in the catalogue."""
    scale: ClassVar[float]
    """Size of the robot over the size of the animal."""
    root_drop: ClassVar[float]
    """How far the robot's base lies below the midpoint of pelvis and neck, after scaling [m]."""
    forward_lift: ClassVar[float]
    """Height by which the neck lies below the trunk's axis through the pelvis, after scaling [m]."""
    foot_outward: ClassVar[float]
    """How far the feet are moved outwards, for the robot's thighs sit beside its hips [m]."""

    def __init_subclass__(cls) -> None:
        """Check that nothing is left out.

        Raises:
            TypeError: a value is missing.
        """
        missing = [name for name in MotionSource.__annotations__ if not hasattr(cls, name)]
        if missing:
            raise TypeError(f"the source {cls.__name__} does not state {', '.join(missing)}")

    def data_file(self, path: Path) -> Path:
        """Return the file that ``path`` is in, for sources that name one motion among several in a file."""
        return path

    @abstractmethod
    def read(self, path: Path) -> KeypointMotion:
        """Read a whole file.

        Raises:
            ClipError: the file is missing or malformed; the message names file and line.
        """
