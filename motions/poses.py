"""Poses of the robot frame by frame: the one form in which motions travel through retargeting."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kine2go_warp.rotations import continuous, from_rotation, heading, to_rotation, turn_planar, yaw_rotation

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Poses:
    """Base poses in the world frame, with joints, foot centres, or both."""

    root_position: Array
    """Base link origin [m], shape [num_frames, 3]."""
    root_orientation: Array
    """Base link orientation (w, x, y, z), shape [num_frames, 4]."""
    joints: Array | None = None
    """Joint positions [rad], shape [num_frames, 12]."""
    feet: Array | None = None
    """Foot centres, FL, FR, RL, RR, world frame [m], shape [num_frames, 4, 3]."""

    def __len__(self) -> int:
        return len(self.root_position)

    def frames(self, start: int, stop: int) -> "Poses":
        """Return the frames ``start`` to ``stop`` (exclusive)."""
        chosen = slice(start, stop)
        return self.taken(np.arange(len(self))[chosen])

    def taken(self, index: NDArray[np.int_]) -> "Poses":
        """Return the frames of the given numbers."""
        return Poses(
            self.root_position[index],
            self.root_orientation[index],
            None if self.joints is None else self.joints[index],
            None if self.feet is None else self.feet[index],
        )

    def moved(self, x: ArrayLike, y: ArrayLike, yaw: ArrayLike) -> "Poses":
        """Turn everything about the world's z axis by ``yaw`` [rad], then shift it by ``x`` and ``y`` [m].

        Each is one number, or has shape [num_frames].
        """
        shift, yaw = np.stack([x, y, np.zeros_like(x)], axis=-1), np.asarray(yaw)
        return replace(
            self,
            root_position=turn_planar(self.root_position, yaw) + shift,
            root_orientation=from_rotation(yaw_rotation(yaw) * to_rotation(self.root_orientation)),
            feet=None if self.feet is None else turn_planar(self.feet, yaw[..., None]) + shift[..., None, :],
        )

    def recentred(self) -> "Poses":
        """Move everything so that frame 0 lies above the origin with heading 0; heights stay."""
        yaw = float(heading(self.root_orientation[:1])[0])
        x, y, _ = turn_planar(-self.root_position[0], -yaw)
        moved = self.moved(float(x), float(y), -yaw)
        return replace(moved, root_orientation=continuous(moved.root_orientation))

    def followed_by(self, other: "Poses") -> "Poses":
        """Return these frames and those of another motion after them."""

        def joined(first: Array | None, second: Array | None) -> Array | None:
            return None if first is None or second is None else np.concatenate([first, second])

        return Poses(
            np.concatenate([self.root_position, other.root_position]),
            np.concatenate([self.root_orientation, other.root_orientation]),
            joined(self.joints, other.joints),
            joined(self.feet, other.feet),
        )

    def extrapolated(self, count: int) -> "Poses":
        """Append frames that go on at the velocity of the last two."""
        poses = self
        for _ in range(count):
            last, before = poses.frames(len(poses) - 1, len(poses)), poses.frames(len(poses) - 2, len(poses) - 1)
            turn = to_rotation(last.root_orientation) * to_rotation(before.root_orientation).inv()
            poses = poses.followed_by(
                Poses(
                    2.0 * last.root_position - before.root_position,
                    from_rotation(turn * to_rotation(last.root_orientation)),
                    None if last.joints is None or before.joints is None else 2.0 * last.joints - before.joints,
                    None if last.feet is None or before.feet is None else 2.0 * last.feet - before.feet,
                )
            )
        return poses
