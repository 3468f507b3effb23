"""A robot in a recording: its meshes, and its reference as a see-through robot of boxes and capsules."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from kine2go_warp.recordings.meshes import Meshes
from kine2go_warp.recordings.shapes import Poses, xyzw
from kine2go_warp.recordings.stream import Colour, Columns
from kine2go_warp.robots import RobotSpec

GHOST: Colour = (120, 150, 200, 60)
"""Colour of the reference."""

EYE = (-0.35, -1.75, 0.85)
"""Where the eye is, seen from the robot that it follows when that begins to move [m]."""

FOLLOWED = "base/followed"
"""What the eye follows, below the entity of a robot."""

STANDING: Colour = (255, 140, 0)
SWINGING: Colour = (45, 47, 54)


@dataclass(frozen=True)
class RobotDrawer:
    """Draws robots of one kind into recordings."""

    spec: RobotSpec
    meshes: Meshes | None = None

    @cached_property
    def shown(self) -> Meshes:
        """The user's meshes, or else our own."""
        return self.meshes or Meshes.of(self.spec)

    def draw(self, columns: Columns, poses: Poses, standing: NDArray[np.bool_]) -> None:
        """Draw the robot itself; feet that stand are marked.

        Args:
            columns: The recording, at the rows of ``poses``.
            poses: Where the robot is.
            standing: Whether each foot stands, shape [num_rows, 4].
        """
        self._draw_base(columns, poses)
        self._place_eye(columns)
        self.shown.draw(columns, poses)
        self._draw_feet(columns, poses, standing)

    def draw_ghost(self, columns: Columns, poses: Poses) -> None:
        """Draw a translucent robot."""
        self._draw_base(columns, poses)
        self._draw_trunk(columns)
        self._draw_legs(columns, poses)

    def _draw_base(self, columns: Columns, poses: Poses) -> None:
        """Move everything that is fixed to the base."""
        pose = rr.Transform3D.columns(translation=poses.root_position, quaternion=xyzw(poses.root_orientation))
        columns.send("base", pose)

    def _place_eye(self, columns: Columns) -> None:
        """Log what the eye follows: two points that are not seen.

        A viewer that has the followed entity when it opens a view takes only the direction of the eye from the layout;
        its distance becomes 1.5 times the diagonal of the entity's bounding box (seen with Rerun 0.41). These points
        make that the distance of ``EYE``.
        """
        reach = float(np.linalg.norm(EYE)) / 3.0
        columns.fix(FOLLOWED, rr.Points3D([[0.0, 0.0, -reach], [0.0, 0.0, reach]], radii=[0.0], colors=[(0, 0, 0, 0)]))

    def _draw_trunk(self, columns: Columns) -> None:
        """Draw trunk and head of the reference, which the base takes along."""
        if not columns.with_fixed:
            return
        half_sizes = [0.5 * np.array(self.spec.trunk_size)]
        columns.fix("base/trunk", rr.Boxes3D(half_sizes=half_sizes, colors=[GHOST], fill_mode="solid"))
        radius = self.spec.head_radius
        ball = rr.Ellipsoids3D(radii=[radius], centers=[self.spec.head_centre], colors=[GHOST], fill_mode="solid")
        columns.fix("base/head", ball)

    def _draw_legs(self, columns: Columns, poses: Poses) -> None:
        """Draw thighs of the reference, then calves. A capsule begins at its lower end."""
        ends = np.concatenate([poses.joint_centres(2), poses.feet], axis=1)
        turns = np.concatenate([poses.thigh, poses.calf], axis=1)
        lengths = [leg.thigh_length for leg in self.spec.legs] + [leg.calf_length for leg in self.spec.legs]
        radii = [self.spec.thigh_radius] * 4 + [self.spec.calf_radius] * 4
        capsules = rr.Capsules3D.from_fields(lengths=lengths, radii=radii, colors=[GHOST] * 8, fill_mode="solid")
        columns.fix("legs", capsules)
        columns.send("legs", rr.Capsules3D.columns(translations=flat(ends), quaternions=flat(xyzw(turns))), 8)

    def _draw_feet(self, columns: Columns, poses: Poses, standing: NDArray[np.bool_]) -> None:
        """Draw the feet, in a colour of their own while they stand."""
        radii = np.full((4, 3), 1.15 * self.spec.foot_radius)
        columns.fix("feet", rr.Ellipsoids3D.from_fields(half_sizes=radii, fill_mode="solid"))
        colours = np.where(standing[..., None], STANDING, SWINGING).astype(np.uint8)
        columns.send("feet", rr.Ellipsoids3D.columns(centers=flat(poses.feet), colors=flat(colours)), 4)


def flat(values: NDArray[Any]) -> NDArray[Any]:
    """Return the instances of all rows one after the other, in single precision unless they are whole numbers."""
    values = values.reshape(-1, values.shape[-1])
    return values if values.dtype.kind == "u" else values.astype(np.float32)
