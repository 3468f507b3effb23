"""What one picture shows, and how that is told to the process that draws."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.renders.camera import View


@dataclass(frozen=True)
class Pose:
    """Where a robot is and how it holds its legs."""

    root_position: NDArray
    """Base link origin in the world [m], shape [3]."""
    root_orientation: NDArray
    """Base link in the world, (w, x, y, z), shape [4]."""
    joint_position: NDArray
    """In the order of ``RobotSpec.joint_names`` [rad], shape [12]."""

    def numbers(self) -> NDArray[np.float64]:
        """Return all of it, shape [19]."""
        return np.concatenate([self.root_position, self.root_orientation, self.joint_position], dtype=np.float64)

    @classmethod
    def of(cls, numbers: NDArray[np.float64]) -> "Pose":
        """Return the pose of which these are the numbers, shape [19]."""
        return cls(numbers[:3], numbers[3:7], numbers[7:])


@dataclass(frozen=True)
class Order:
    """One picture to draw."""

    robot: Pose
    reference: Pose
    view: View
    show_reference: bool = True
    show_floor: bool = True

    NUM_BYTES = 8 * (19 + 19 + 6 + 2)

    def to_bytes(self) -> bytes:
        """Return the order as doubles."""
        view = [*self.view.target, self.view.azimuth, self.view.distance, self.view.elevation]
        switches = [float(self.show_reference), float(self.show_floor)]
        return np.concatenate([self.robot.numbers(), self.reference.numbers(), view, switches]).tobytes()

    @classmethod
    def from_bytes(cls, data: bytes) -> "Order":
        """Return the order that was turned into these bytes."""
        numbers = np.frombuffer(data)
        x, y, z, azimuth, distance, elevation, reference, floor = numbers[38:].tolist()
        view = View(np.array([x, y, z]), azimuth, distance, elevation)
        return cls(Pose.of(numbers[:19]), Pose.of(numbers[19:38]), view, bool(reference), bool(floor))
