"""Variations of a clip: at another pace, as its mirror image, at another speed, and along a bent path."""

from dataclasses import dataclass, replace

import numpy as np

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.motions.cycle import CycleStep
from kine2go_warp.quantities import MIRRORED_LEGS, MIRRORED_SIGNS, mirrored
from kine2go_warp.rotations import from_rotation, heading, to_rotation, turn_planar, yaw_rotation


@dataclass(frozen=True)
class Variation:
    """How a reference differs from its clip. The defaults change nothing, not even a bit."""

    time_scale: float = 1.0
    """Duration over the clip's."""
    mirrored: bool = False
    """Whether left and right are exchanged."""
    speed_offset: float = 0.0
    """Speed added along the root's heading [m/s]."""
    turn_offset: float = 0.0
    """Yaw rate added to the root, whose path bends with it [rad/s]."""

    def of(self, clip: MotionClip) -> MotionClip:
        """Return the clip varied: first mirrored, then at its pace, then with the offsets. It is as periodic as before.

        Joint positions stay those of the clip, so with an offset of the speed standing feet slide in the reference.

        Raises:
            ClipError: it has an offset, but the clip is played once: its ends must be at rest.
        """
        if self == Variation():
            return clip
        if self.mirrored:
            clip = mirror_image(clip)
        scaled = {"frame_duration": clip.frame_duration * self.time_scale, "keypoints": None, "fidelity": None}
        clip = replace(clip, time_scale=clip.time_scale * self.time_scale, **scaled)
        if self.speed_offset or self.turn_offset:
            clip = self._bent(clip)
        return clip.completed(clip.spec)

    def _bent(self, clip: MotionClip) -> MotionClip:
        """Return poses and displacement of a clip whose root goes on with the offsets added."""
        if clip.cycle is None:
            raise ClipError(f"{clip.name} is played once and takes no speed_offset or turn_offset")
        poses = clip.extended(0, 1)
        yaw = np.unwrap(heading(poses.root_orientation))
        angle = self.turn_offset * clip.frame_duration * np.arange(clip.num_frames + 1)
        middle = 0.5 * (angle[1:] + angle[:-1])
        steps = turn_planar(np.diff(poses.root_position, axis=0), middle)
        along = 0.5 * (yaw[1:] + yaw[:-1]) + middle
        steps[:, :2] += self.speed_offset * clip.frame_duration * np.stack([np.cos(along), np.sin(along)], axis=-1)
        position = poses.root_position[0] + np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        turn = clip.cycle.yaw + float(angle[-1])
        moved = position[-1] - turn_planar(position[0], turn)
        orientation = from_rotation(yaw_rotation(angle[:-1]) * to_rotation(clip.root_orientation))
        cycle = CycleStep(float(moved[0]), float(moved[1]), turn)
        return replace(clip, root_position=position[:-1], root_orientation=orientation, cycle=cycle)


def mirror_image(clip: MotionClip) -> MotionClip:
    """Return the poses of a clip with left and right exchanged; velocities and feet are left as they were."""
    places, signs = mirrored(("joint",), "angle")
    legs = list(MIRRORED_LEGS)
    return replace(
        clip,
        root_position=clip.root_position * MIRRORED_SIGNS["vector"],
        root_orientation=clip.root_orientation * (1.0, *MIRRORED_SIGNS["rotation"]),
        joint_position=clip.joint_position[:, list(places)] * signs,
        stance=clip.stance[:, legs],
        keypoints=None if clip.keypoints is None else clip.keypoints.mirrored(),
        cycle=None if clip.cycle is None else CycleStep(clip.cycle.x, -clip.cycle.y, -clip.cycle.yaw),
    )
