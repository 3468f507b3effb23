"""What a saved clip must fulfil before anything is trained on it or measured with it."""

from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.keypoints import MINIMUM_FRAMES
from kine2go_warp.names import check_name
from kine2go_warp.robots import RobotSpec
from kine2go_warp.tables import counted

if TYPE_CHECKING:
    from kine2go_warp.motions.clip import MotionClip

Array = NDArray[np.float64]

SHAPES = {
    "root_position": (3,),
    "root_orientation": (4,),
    "joint_position": (12,),
    "root_linear_velocity": (3,),
    "root_angular_velocity": (3,),
    "joint_velocity": (12,),
    "foot_position": (4, 3),
    "stance": (4,),
    "body_rests": (2,),
    "residual": (),
}
"""Of each array, after the frames."""
FRAME_DURATIONS = 1e-3, 1.0
"""Shortest and longest time from one frame to the next [s]."""
BEYOND_LIMITS = 0.1
"""How far a joint may be beyond its limits [rad]."""
FOOT_HEIGHTS = -0.1, 1.0
"""Between these heights the lowest foot of a clip lies [m]."""
UNIT_TOLERANCE = 1e-3
SHARES = ("stance", "body_rests")
"""Arrays of numbers from 0 to 1."""
AT_REST = 0.2
"""Greatest speed of a joint [rad/s], or of the base along an axis [m/s], at the ends of a clip that is played once."""
SAME_TOLERANCE = 1e-3
"""How far stored velocities and feet may be from those that follow from the poses, relative to the largest."""


def validate(clip: "MotionClip", path: Path) -> None:
    """Check a clip that has been read from a file.

    Raises:
        ClipError: names, shapes, units, numbers or limits are not those of a clip; the message says which.
        Kine2GoError: its robot is not available here.
    """
    check_name(clip.name, path, ClipError)
    check_header(clip, path)
    check_arrays(clip, path)
    check_numbers(clip, path)
    spec = clip.spec
    check_joints(clip, spec, path)
    check_ends(clip, path)
    check_derived(clip, spec, path)


def check_header(clip: "MotionClip", path: Path) -> None:
    """Refuse a robot or an origin of another type."""
    texts = {"robot": clip.robot}
    for one in fields(clip.origin):
        value = getattr(clip.origin, one.name)
        if isinstance(one.default, str):
            texts[f"origin.{one.name}"] = value
        elif not isinstance(value, int | float):
            raise ClipError(f"{path}: origin.{one.name} is {value!r:.40}, not a number; retarget it again")
    for name, value in texts.items():
        if not isinstance(value, str):
            raise ClipError(f"{path}: {name} is {value!r:.40}, not a text; retarget it again")


def check_arrays(clip: "MotionClip", path: Path) -> None:
    """Refuse arrays of wrong kinds or shapes, and numbers that are not finite."""
    frames = len(clip.root_position) if np.ndim(clip.root_position) else 0
    if frames < MINIMUM_FRAMES:
        raise ClipError(
            f"{path}: {counted(frames, 'frame')}; a clip needs at least {MINIMUM_FRAMES}; retarget it again"
        )
    for name, shape in SHAPES.items():
        values = getattr(clip, name)
        if values.dtype.kind not in "fiu":
            raise ClipError(f"{path}: {name} holds {values.dtype}, not numbers; retarget it again")
        if values.shape != (frames, *shape):
            raise ClipError(f"{path}: {name} has shape {values.shape}, not {(frames, *shape)}; retarget it again")
        if not np.isfinite(values).all():
            frame = int(np.argwhere(~np.isfinite(values))[0][0])
            raise ClipError(f"{path}: {name} is not finite in frame {frame}; retarget it again")
        if name in SHARES and not 0.0 <= values.min() <= values.max() <= 1.0:
            raise ClipError(f"{path}: {name} holds numbers beyond 0 to 1; retarget it again")


def check_numbers(clip: "MotionClip", path: Path) -> None:
    """Refuse durations, cycles and orientations that no motion has."""
    numbers = {name: getattr(clip, name) for name in ("frame_duration", "slow_down", "time_scale")}
    if clip.cycle is not None:
        numbers |= {f"cycle.{item.name}": getattr(clip.cycle, item.name) for item in fields(clip.cycle)}
    for name, value in numbers.items():
        if not isinstance(value, int | float) or isinstance(value, bool) or not np.isfinite(value):
            raise ClipError(f"{path}: {name} is {value!r:.40}, not a finite number; retarget it again")
        if name in ("slow_down", "time_scale") and value <= 0.0:
            raise ClipError(f"{path}: {name} is {value:g} and must be positive; retarget it again")
    shortest, longest = FRAME_DURATIONS
    if not shortest <= clip.frame_duration <= longest:
        raise ClipError(
            f"{path}: frame_duration is {clip.frame_duration:g} s, not within {shortest:g} to {longest:g} s"
        )
    length = np.linalg.norm(clip.root_orientation, axis=1)
    if np.abs(length - 1.0).max() > UNIT_TOLERANCE:
        frame = int(np.argmax(np.abs(length - 1.0)))
        raise ClipError(f"{path}: root_orientation has length {length[frame]:.3g}, not 1, in frame {frame}")


def check_joints(clip: "MotionClip", spec: RobotSpec, path: Path) -> None:
    """Refuse joints beyond their limits, as degrees are, and a robot far above or below the floor."""
    beyond = np.maximum(clip.joint_position - spec.joint_upper, np.array(spec.joint_lower) - clip.joint_position)
    if beyond.max() > BEYOND_LIMITS:
        frame, joint = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
        raise ClipError(
            f"{path}: {spec.joint_names[joint]} is {clip.joint_position[frame, joint]:.3g} rad in frame {frame}, "
            f"{beyond.max():.2g} rad beyond its limit; joints are in radians, in the order of the robot"
        )
    lowest, (least, most) = float(clip.foot_position[..., 2].min()), FOOT_HEIGHTS
    if not least <= lowest <= most:
        raise ClipError(f"{path}: the lowest foot is {lowest:.3g} m over the floor, not within {least:g} to {most:g} m")


def check_ends(clip: "MotionClip", path: Path) -> None:
    """Refuse a clip that is played once and moves at its ends."""
    if clip.cycle is not None:
        return
    moved = [*clip.joint_position.T, *clip.root_position.T]
    fastest = max(abs(float(one[place + 1] - one[place])) for one in moved for place in (0, -2)) / clip.frame_duration
    if fastest > AT_REST:
        raise ClipError(
            f"{path}: it is played once, but moves at {fastest:.2g} rad/s or m/s at an end; "
            "hold its ends for longer ('hold = 1.0' in its catalogue)"
        )


def check_derived(clip: "MotionClip", spec: RobotSpec, path: Path) -> None:
    """Refuse velocities and feet that do not follow from the poses."""
    follows = clip.completed(spec)
    for name in ("root_linear_velocity", "root_angular_velocity", "joint_velocity", "foot_position"):
        stored, expected = getattr(clip, name), getattr(follows, name)
        off = float(np.abs(stored - expected).max())
        if off > SAME_TOLERANCE * max(1.0, float(np.abs(expected).max())):
            raise ClipError(f"{path}: {name} is up to {off:.3g} off what follows from the poses; retarget it again")
