"""The source's keypoints over a clip, to look at beside the robot."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.motions.cycle import CycleStep, continued
from kine2go_warp.motions.keypoints import BONES, KEYPOINTS, KeypointMotion
from kine2go_warp.quantities import LEG_NAMES, MIRRORED_LEGS, MIRRORED_SIGNS
from kine2go_warp.rotations import heading, turn_planar, wrap_angle

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Skeleton:
    """Points of an animal over one clip, and the bones between them.

    They are in the robot's size and in the world frame of the clip, but otherwise as the source has them: neither
    smoothed nor closed to a cycle, so the seam shows.
    """

    names: tuple[str, ...]
    """Of the points."""
    bones: tuple[tuple[int, int], ...]
    """Pairs of points, by their places in ``names``."""
    position: Array
    """[m], shape [num_frames, num_points, 3]."""

    def __post_init__(self) -> None:
        count = len(self.names)
        if self.position.ndim != 3 or self.position.shape[1:] != (count, 3):
            raise ValueError(f"keypoints have shape {self.position.shape}, not (num_frames, {count}, 3)")
        if not all(0 <= point < count for bone in self.bones for point in bone):
            raise ValueError(f"bones {self.bones} lead beyond the {count} keypoints")

    def over_cycles(self, cycle: CycleStep | None, cycles: int) -> Array:
        """Return the points over some cycles [m], shape [cycles * num_frames, num_points, 3].

        Without ``cycle`` they stay where they are at the end.
        """
        if cycle is None:
            frames = np.arange(cycles * len(self.position))
            return self.position[continued(frames, len(self.position), is_cycle=False)]
        steps = [cycle.repeated(turn) for turn in range(cycles)]
        parts = [turn_planar(self.position, step.yaw) + np.array([step.x, step.y, 0.0]) for step in steps]
        return np.concatenate(parts)

    def resampled(self, places: Array, cycle: CycleStep | None) -> "Skeleton":
        """Return the points at places between the frames, interpolated linearly.

        Args:
            places: In frames, at least 0 and less than the number of frames, shape [num_places].
            cycle: Displacement of one cycle, if it is one.
        """
        longer = self.over_cycles(cycle, 2)
        before = np.floor(places).astype(int)
        share = (places - before)[:, None, None]
        return Skeleton(self.names, self.bones, (1.0 - share) * longer[before] + share * longer[before + 1])

    def mirrored(self) -> "Skeleton":
        """Return the mirror image: the points of left and right legs, told by their names, change places."""
        images = [
            f"{LEG_NAMES[MIRRORED_LEGS[LEG_NAMES.index(name[:2])]]}{name[2:]}" if name[:2] in LEG_NAMES else name
            for name in self.names
        ]
        position = self.position[:, [self.names.index(name) for name in images]] * MIRRORED_SIGNS["vector"]
        return replace(self, position=position)

    def as_arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays that a file keeps."""
        return {
            "keypoint_name": np.array(self.names),
            "keypoint_bone": np.array(self.bones, dtype=np.int32).reshape(-1, 2),
            "keypoint_position": self.position,
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> "Skeleton | None":
        """Undo ``as_arrays``; None if a file keeps no keypoints.

        Raises:
            ValueError: they do not fit together.
        """
        if "keypoint_position" not in arrays:
            return None
        names = tuple(str(name) for name in arrays["keypoint_name"])
        bones = tuple((int(first), int(second)) for first, second in arrays["keypoint_bone"])
        return cls(names, bones, arrays["keypoint_position"])


def skeleton_at(
    motion: KeypointMotion, floor: float, source_root: tuple[Array, Array], clip_root: tuple[Array, Array]
) -> Skeleton:
    """Place an animal's keypoints where the robot is.

    They are moved and turned in the ground plane as a whole, so that the way of the base that they ask for lies on the
    clip's as well as it can.

    Args:
        motion: The frames of the clip, in the robot's size.
        floor: Height of the animal's floor [m].
        source_root: Positions [m] and orientations (w, x, y, z) of the base that the keypoints ask for, frame by frame.
        clip_root: The same of the clip.
    """
    (wanted, wanted_turn), (given, given_turn) = source_root, clip_root
    turns = wrap_angle(heading(given_turn) - heading(wanted_turn))
    yaw = float(np.arctan2(np.sin(turns).mean(), np.cos(turns).mean()))
    shift = (given - turn_planar(wanted, yaw)).mean(axis=0)
    shift[2] = -floor
    return Skeleton(KEYPOINTS, BONES, turn_planar(motion.position, yaw) + shift)
