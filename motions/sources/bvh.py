"""BVH files: the skeleton, the channels of every frame, and where the joints are."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.keypoints import MINIMUM_FRAMES, RATES
from kine2go_warp.motions.sources.tables import read_text

Array = NDArray[np.float64]

END = "Site"
"""What an end of the skeleton is named after its joint: the end of ``LeftHand`` is ``LeftHandSite``."""
MOST_JOINTS = 1000
LARGEST_NUMBER = 1e6


@dataclass(frozen=True)
class Joint:
    """A joint, or an end, of the skeleton."""

    name: str
    parent: int
    """Place of the parent in the list of joints; -1 for the root."""
    offset: tuple[float, float, float]
    """From the parent, in the file's unit."""
    channels: tuple[str, ...] = ()
    """Such as ``Xposition`` or ``Zrotation``, in the order of the columns and of the rotations."""


@dataclass(frozen=True)
class Bvh:
    """What is in a BVH file."""

    joints: tuple[Joint, ...]
    """Parents before their children."""
    rate: float
    """Frames per second [Hz]."""
    values: Array
    """Channels of all frames, in degrees and the file's unit, shape [num_frames, num_channels]."""

    def lost(self) -> NDArray[np.bool_]:
        """Return which frames are zero in every channel, as recorders write those that they missed.

        Files may begin with such a frame: there it is the pose that the skeleton was bound in.
        """
        is_zero = ~self.values.any(axis=1)
        return is_zero & ~np.logical_and.accumulate(is_zero)

    def positions(self) -> dict[str, Array]:
        """Return where each joint is, in the file's axes and unit, each of shape [num_frames, 3].

        A joint with channels of position is where they say, seen from its parent; its offset, which writers of BVH use
        in more than one way, is then left out. Frames that were lost are NaN.
        """
        lost = self.lost()[:, None]
        places: list[tuple[Rotation, Array]] = []
        column, found = 0, {}
        for joint in self.joints:
            values = dict(zip(joint.channels, self.values[:, column : column + len(joint.channels)].T, strict=True))
            column += len(joint.channels)
            here = np.stack(
                [
                    values.get(f"{axis}position", np.full(len(self.values), offset))
                    for axis, offset in zip("XYZ", joint.offset, strict=True)
                ],
                axis=-1,
            )
            turns = [name for name in joint.channels if name.endswith("rotation")]
            turn = Rotation.identity(len(self.values))
            if turns:
                angles = np.stack([values[name] for name in turns], axis=-1)
                turn = Rotation.from_euler("".join(name[0] for name in turns), angles, degrees=True)
            if joint.parent >= 0:
                rotation, origin = places[joint.parent]
                here, turn = origin + rotation.apply(here), rotation * turn
            places.append((turn, here))
            found[joint.name] = np.where(lost, np.nan, here)
        return found


def read_bvh(path: Path) -> Bvh:
    """Read a BVH file.

    Raises:
        ClipError: the file is missing or is no BVH file; the message names the line.
    """
    lines = read_text(path).splitlines()
    start = next((number for number, line in enumerate(lines) if line.strip().upper() == "MOTION"), None)
    if not lines or lines[0].split()[:1] != ["HIERARCHY"] or start is None:
        raise ClipError(f"{path}: not a BVH file, which has a line HIERARCHY and a line MOTION")
    joints = _Hierarchy(path, lines[:start]).joints()
    frames = _header(path, lines, start + 1, "Frames:")
    duration = _header(path, lines, start + 2, "Frame Time:")
    if not MINIMUM_FRAMES <= frames <= 1e7 or frames != int(frames):
        raise ClipError(f"{path}, line {start + 2}: {frames:g} frames; a motion needs at least {MINIMUM_FRAMES}")
    if not 1.0 / RATES[1] <= duration <= 1.0 / RATES[0]:
        raise ClipError(f"{path}, line {start + 3}: a frame time of {duration:g} s; 0.001 to 1 s can be used")
    width = sum(len(joint.channels) for joint in joints)
    values = _numbers(path, [line for line in lines[start + 3 :] if line.strip()], int(frames), width, start + 4)
    return Bvh(joints, 1.0 / duration, values)


def _header(path: Path, lines: list[str], index: int, name: str) -> float:
    """Return the number of a line such as ``Frames: 120``."""
    words = lines[index].split(name) if index < len(lines) else []
    try:
        return float(words[1])
    except (IndexError, ValueError):
        raise ClipError(f"{path}, line {index + 1}: expected '{name}' and a number") from None


def _numbers(path: Path, lines: list[str], frames: int, width: int, first_line: int) -> Array:
    """Return the rows of numbers below the headers, shape [frames, width]."""
    if len(lines) < frames:
        raise ClipError(f"{path}: {len(lines)} frames instead of the {frames} that it announces; it was cut off")
    rows = np.empty((frames, width))
    for index, line in enumerate(lines[:frames]):
        words = line.split()
        if len(words) != width:
            raise ClipError(f"{path}, line {index + first_line}: {len(words)} columns instead of {width}")
        try:
            rows[index] = words
        except ValueError as error:
            raise ClipError(f"{path}, line {index + first_line}: not a number ({error})") from None
        if not np.all(np.abs(rows[index]) <= LARGEST_NUMBER):
            raise ClipError(f"{path}, line {index + first_line}: a value is not finite or exceeds {LARGEST_NUMBER:g}")
    return rows


class _Hierarchy:
    """Reads the lines of a skeleton."""

    def __init__(self, path: Path, lines: list[str]) -> None:
        self.path, self.lines = path, lines

    def joints(self) -> tuple[Joint, ...]:
        """Return the joints in the order of the file."""
        found: list[Joint] = []
        open_joints: list[int] = []
        for number, line in enumerate(self.lines[1:], start=2):
            words = line.split()
            if not words or words == ["{"]:
                continue
            where = f"{self.path}, line {number}"
            if words == ["}"]:
                if not open_joints:
                    raise ClipError(f"{where}: a bracket too many")
                open_joints.pop()
            elif words[0] in ("ROOT", "JOINT") and len(words) >= 2:
                name = " ".join(words[1:])
                if any(joint.name == name for joint in found):
                    raise ClipError(f"{where}: a second joint '{name}'")
                self.add(found, open_joints, name, where)
            elif words[:2] == ["End", "Site"]:
                if not open_joints:
                    raise ClipError(f"{where}: an end of no joint")
                self.add(found, open_joints, found[open_joints[-1]].name + END, where)
            elif words[0] in ("OFFSET", "CHANNELS") and open_joints:
                self.complete(found, open_joints[-1], words, where)
            else:
                raise ClipError(f"{where}: '{line.strip()[:40]}' is nothing that a skeleton has here")
        if open_joints or not found:
            raise ClipError(f"{self.path}: the skeleton ends within a joint; the file is damaged")
        return tuple(found)

    def add(self, found: list[Joint], open_joints: list[int], name: str, where: str) -> None:
        """Begin a joint."""
        if (found and not open_joints) or len(found) >= MOST_JOINTS:
            raise ClipError(f"{where}: a second root, or more than {MOST_JOINTS} joints")
        found.append(Joint(name, open_joints[-1] if open_joints else -1, (0.0, 0.0, 0.0)))
        open_joints.append(len(found) - 1)

    def complete(self, found: list[Joint], index: int, words: list[str], where: str) -> None:
        """Give a joint its offset or its channels."""
        joint = found[index]
        if words[0] == "OFFSET":
            try:
                x, y, z = (float(word) for word in words[1:])
            except ValueError:
                raise ClipError(f"{where}: an offset is three numbers") from None
            if not all(abs(value) <= LARGEST_NUMBER for value in (x, y, z)):
                raise ClipError(f"{where}: an offset is not finite or exceeds {LARGEST_NUMBER:g}")
            found[index] = Joint(joint.name, joint.parent, (x, y, z), joint.channels)
            return
        channels = tuple(words[2:])
        known = {axis + kind for axis in "XYZ" for kind in ("position", "rotation")}
        if words[1:2] != [str(len(channels))] or not known.issuperset(channels) or len(set(channels)) < len(channels):
            raise ClipError(f"{where}: channels are a number and as many of {', '.join(sorted(known))}")
        found[index] = Joint(joint.name, joint.parent, joint.offset, channels)
