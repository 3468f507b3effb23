"""Motions that are a robot's already: its base and joints, of whatever robot and in whatever order.

They go through the positions of the feet, as an animal's do, and so through the same cleaning and report.
"""

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.examination import check_angles, check_height
from kine2go_warp.motions.keypoints import KEYPOINTS, KeypointMotion
from kine2go_warp.motions.sources.base import MotionSource
from kine2go_warp.motions.sources.dialects import JointsDialect, robot_of_files
from kine2go_warp.motions.sources.joint_files import Rows, read_arrays, read_frames, read_pickle, read_table, read_torch
from kine2go_warp.quantities import LEG_NAMES
from kine2go_warp.robots import GO2
from kine2go_warp.robots.kinematics import HasLegs, foot_positions
from kine2go_warp.robots.spec import GO2_LEG_LENGTH, GO2_THIGH_OFFSET
from kine2go_warp.rotations import heading, turn_planar

Array = NDArray[np.float64]

READERS = {
    "frames": read_frames,
    "pickle": read_pickle,
    "joint_table": read_table,
    "joint_arrays": read_arrays,
    "torch": read_torch,
}
ORDERS = tuple(tuple(order.split()) for order in ("FL FR RL RR", "FR FL RR RL", "RL RR FL FR", "RR RL FR FL"))
"""Orders of the legs that are tried where the file does not tell."""
FITS = 0.03
"""Feet by the joints are this close to the file's own, but for a shift that all share, or it is another robot [m]."""
UPRIGHT = 0.5
"""The base's z axis points up by this much, in the median of the frames."""
SLOWEST_JUMP = 2.5
"""A point that comes or goes more slowly has not jumped, in the size of the Go2 [m/s]: a robot has no markers that get
lost, and its feet do twitch. In 76 clips what looked like a jump came or went at 1.6 m/s at most."""
TRUNK_HALF_LENGTH = 0.1
"""How far neck and pelvis are put before and behind the base's origin, in the size of the Go2 [m]."""


@dataclass(frozen=True)
class Fit:
    """Whose joints a file has."""

    robot: str
    legs: tuple[str, ...]
    """Order of the legs in the file."""
    error: float
    """Median distance of the feet from the file's own [m]; NaN where it has none."""


@dataclass(frozen=True)
class JointSource(MotionSource):
    """Reads files of one dialect. Motions come out in the size of the Go2, whatever robot they are of.

    Feet are taken to be as thick as the Go2's then.
    """

    name: str
    dialect: JointsDialect
    scale: float = 1.0
    root_drop: float = 0.0
    forward_lift: float = 0.0
    foot_outward: float = GO2_THIGH_OFFSET
    """Feet are told from the hips as if the thighs sat right there."""

    def takes(self, rows: Rows) -> bool:
        """Return whether rows of numbers are likely those of this dialect."""
        return self.dialect.width in (0, rows.values.shape[1]) and self.dialect.tells_legs == bool(rows.legs)

    def names_columns(self, names: Collection[str]) -> bool:
        """Return whether a table has the columns of this dialect."""
        dialect = self.dialect
        return set(dialect.position + dialect.orientation + dialect.joints + dialect.toes) <= set(names)

    def read(self, path: Path) -> KeypointMotion:
        """Read a whole file; see ``MotionSource.read``."""
        rows = READERS[self.dialect.format](path)
        if self.dialect.width not in (0, rows.values.shape[1]):
            raise ClipError(f"{path}: {rows.values.shape[1]} columns, not the {self.dialect.width} of {self.name}")
        rate = rows.rate or self.dialect.rate
        if rate == 0.0:
            raise ClipError(f"{path}: tells no rate; state it in the table of the source, as in rate = 50")
        rotation = self.orientation(rows, path)
        if np.median(rotation.as_matrix()[:, 2, 2]) < UPRIGHT:
            raise ClipError(f"{path}: the robot does not stand upright; state how {self.name} has it with 'turned'")
        position = rows.take(self.dialect.position, str(path))
        fit = self.fit(rows, path)
        joints = self.joints(rows, fit.legs, path)
        if np.median(joints[:, 2::3]) > 0.0:
            raise ClipError(f"{path}: the knees bend forward; state the direction of the joints with 'sign'")
        robot = robot_of_files(fit.robot)
        size = GO2_LEG_LENGTH / (robot.legs[0].thigh_length + robot.legs[0].calf_length)
        feet = foot_positions(robot, joints)
        points = robot_points(robot, rotation, position, feet)
        check_height(position[:, 2], points[:, -4:, 2], str(path))
        time = np.arange(len(position)) / rate
        notes = notes_on(fit, size)
        return KeypointMotion(time, size * points, notes=notes, foot_radius=GO2.foot_radius, slowest_jump=SLOWEST_JUMP)

    def orientation(self, rows: Rows, path: Path) -> Rotation:
        """Return the orientation of the base in every frame."""
        values = rows.take(self.dialect.orientation, str(path))
        if self.dialect.form == "rotation_vector":
            rotation = Rotation.from_rotvec(values)
        else:
            if np.any(np.abs(np.linalg.norm(values, axis=1) - 1.0) > 1e-2):
                frame = int(np.argmax(np.abs(np.linalg.norm(values, axis=1) - 1.0)))
                raise ClipError(f"{path}, frame {frame}: the orientation is no unit quaternion")
            rotation = Rotation.from_quat(values, scalar_first=self.dialect.form == "wxyz")
        return rotation * Rotation.from_quat(self.dialect.turned).inv()

    def joints(self, rows: Rows, order: tuple[str, ...], path: Path) -> Array:
        """Return the joints in our order and directions [rad], shape [num_frames, 12]."""
        values = rows.take(self.dialect.joints, str(path))
        if values.shape[1] != 12:
            raise ClipError(f"{path}: {values.shape[1]} columns of joints, not 12")
        joints = values.reshape(-1, 4, 3)[:, [order.index(leg) for leg in LEG_NAMES]] * self.dialect.sign
        if self.dialect.mirrored_hips:
            joints[:, [leg[1] == "R" for leg in LEG_NAMES], 0] *= -1.0
        found = (joints + self.dialect.offset).reshape(-1, 12)
        check_angles(found, str(path))
        return found

    def fit(self, rows: Rows, path: Path) -> Fit:
        """Return whose joints a file has, by the file's own columns of feet where there are any.

        Raises:
            ClipError: no robot fits.
        """
        told = tuple(leg.replace("H", "R") for leg in rows.legs) or self.dialect.legs
        if told and sorted(told) != sorted(LEG_NAMES):
            raise ClipError(f"{path}: names its legs {', '.join(rows.legs)}")
        if not self.dialect.toes:
            return Fit(rows.robot or self.dialect.robots[0], told or LEG_NAMES, float("nan"))
        toes = rows.take(self.dialect.toes, str(path)).reshape(-1, 4, 3)
        fits = []
        for robot in self.dialect.robots:
            for order in (told,) if told else ORDERS:
                ours = foot_positions(robot_of_files(robot), self.joints(rows, order, path))
                off = ours - toes[:, [order.index(leg) for leg in LEG_NAMES]]
                off -= off.mean(axis=(0, 1))
                fits.append(Fit(robot, order, float(np.median(np.linalg.norm(off, axis=-1)))))
        best = min(fits, key=lambda fit: fit.error)
        if not best.error <= FITS:
            raise ClipError(
                f"{path}: its columns of feet fit the joints of none of {', '.join(self.dialect.robots)}, in no "
                f"order of the legs; {best.robot} comes within {1e3 * best.error:.0f} mm"
            )
        return best


def robot_points(robot: HasLegs, rotation: Rotation, position: Array, feet: Array) -> Array:
    """Return the keypoints of a robot [m], shape [num_frames, 10, 3].

    Args:
        robot: Its legs.
        rotation: Orientation of the base.
        position: Of the base [m], shape [num_frames, 3].
        feet: In the frame of the base [m], shape [num_frames, 4, 3].
    """
    turn = rotation.as_matrix()
    forward = turn @ np.array([TRUNK_HALF_LENGTH, 0.0, 0.0])
    facing = heading(rotation.as_quat(scalar_first=True))
    points = {"pelvis": position - forward, "neck": position + forward}
    for index, leg in enumerate(robot.legs):
        beside = turn_planar(np.broadcast_to(leg.thigh_offset, position.shape), facing)
        points[f"{leg.name}_hip"] = position + turn @ np.array(leg.hip_offset) + beside
        points[f"{leg.name}_toe"] = position + np.einsum("tij,tj->ti", turn, feet[:, index])
    return np.stack([points[name] for name in KEYPOINTS], axis=1)


def notes_on(fit: Fit, size: float) -> tuple[str, ...]:
    """Return what was taken for granted about a file."""
    found = "" if np.isnan(fit.error) else f", {1e3 * fit.error:.1f} mm from its columns of feet"
    scaled = "" if size == 1.0 else f", enlarged by {size:.3f} to the Go2"
    return (f"joints of {fit.robot}, legs {' '.join(fit.legs)}{found}{scaled}",)
