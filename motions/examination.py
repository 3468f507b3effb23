"""Examining keypoints, whichever reader they come from: what can be repaired is, with a remark; the rest is refused.

Frames are counted from 0, as in the catalogue's ranges.
"""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.floor import levelled
from kine2go_warp.motions.keypoints import KEYPOINTS, KeypointMotion
from kine2go_warp.motions.stance import intervals
from kine2go_warp.quantities import LEG_NAMES

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LONGEST_GAP = 0.25
"""Gaps up to this long are filled [s]."""
GLITCH_FRAMES = 3
LONGEST_GLITCH = 0.05
"""A point that is elsewhere for up to so many frames and this time [s], and back again, has jumped."""
GLITCH_RATIO, GLITCH_SIZE = 6.0, 0.05
"""A jump is this many times what the point's way bends beside it, and this share of the trunk's length. In all real
clips at hand the ratio stays below 2.9."""
CATCH_UP = 2.0
"""A point was held if the step after it stood still is this many times the steps around."""
TRUNK_LENGTHS = (0.08, 0.8)
"""Shortest and longest trunk after scaling to the robot [m]."""
LARGEST_ANGLE = 2.0 * np.pi
"""No joint of a robot turns farther [rad]."""
HIGHEST_STAND = 2.0
"""Feet of a robot whose joints are in radians are no higher than this in the median [m]."""
UNITS = {"metres": 1.0, "centimetres": 1e-2, "millimetres": 1e-3, "inches": 0.0254, "feet": 0.3048}
REST_FRAMES = 3
"""A file may begin with so many frames of the pose that its skeleton was bound in."""
PAIRS = ((0, 1), (2, 3))
"""Left and right leg, front and hind."""


def examined(motion: KeypointMotion, scale: float, unit: str, where: str) -> KeypointMotion:
    """Return a motion with its faults repaired, on a level floor; remarks tell what was done.

    Args:
        motion: As a reader delivers it.
        scale: Size of the robot over that of the animal.
        unit: Name of the unit that the reader takes its file to be in.
        where: The file, for messages.

    Raises:
        ClipError: a fault cannot be repaired; the message names file, frame and point.
    """
    check_size(motion.trunk_length, scale, unit, where)
    size, shortest = motion.trunk_length, motion.slowest_jump / motion.rate
    position, remarks = repaired(motion.position, KEYPOINTS, size, motion.rate, where, shortest)
    motion = replace(motion, position=position, remarks=motion.remarks + remarks)
    return levelled(right_sides(motion, where))


def check_size(length: float, scale: float, unit: str, where: str) -> None:
    """Refuse a trunk that no animal has, and name the likely unit.

    Raises:
        ClipError: it is far from the robot's size after scaling.
    """
    if TRUNK_LENGTHS[0] <= scale * length <= TRUNK_LENGTHS[1]:
        return
    likely = likely_unit(UNITS[unit] * 0.3 / (scale * max(length, 1e-12)))
    guess = f"; it is likely in {likely}" if likely != unit else ""
    raise ClipError(f"{where}: a trunk of {length:.3g} m, so the file is not in {unit}{guess}")


def check_angles(joints: Array, where: str) -> None:
    """Refuse joints that turn farther than a robot's [rad].

    Raises:
        ClipError: one does; the message guesses that the file has degrees.
    """
    largest = np.abs(joints).max()
    if largest > LARGEST_ANGLE:
        raise ClipError(f"{where}: a joint at {largest:.4g} rad; are the file's angles in degrees?")


def check_height(base: Array, feet: Array, where: str) -> None:
    """Refuse positions of a robot's base in another unit than metres, which its size cannot tell.

    Args:
        base: Height of the base [m], shape [num_frames].
        feet: Height of the feet [m], shape [num_frames, 4].
        where: The file, for messages.

    Raises:
        ClipError: the feet are far off the ground.
    """
    off = float(np.median(feet.min(axis=1)))
    if abs(off) > HIGHEST_STAND:
        high = float(np.median(base))
        likely = likely_unit((high - off) / max(abs(high), 1e-12))
        raise ClipError(f"{where}: the feet are {off:.3g} m off the ground; the base's position is likely in {likely}")


def likely_unit(metres: float) -> str:
    """Return the name of the unit that is nearest to a length [m]."""
    return min(UNITS, key=lambda name: abs(np.log(UNITS[name] / metres)))


def right_sides(motion: KeypointMotion, where: str) -> KeypointMotion:
    """Return a motion whose left feet are on the left; a pair of feet under each other's name is put right.

    Raises:
        ClipError: the animal is upside down or mirrored, or its front and hind legs are swapped.
    """
    forward = (motion.point("neck") - motion.point("pelvis")) * [1.0, 1.0, 0.0]
    left = np.cross([0.0, 0.0, 1.0], forward)
    toes = motion.points("toe")
    middle = 0.5 * (motion.point("neck") + motion.point("pelvis"))
    if np.median(middle[:, 2] - toes[..., 2].mean(axis=1)) < 0.0:
        raise ClipError(f"{where}: the feet are above the trunk; the file's up axis is another one than the reader's")
    if np.median(np.sum((toes[:, :2].mean(axis=1) - toes[:, 2:].mean(axis=1)) * forward, axis=1)) < 0.0:
        raise ClipError(f"{where}: the front feet are behind the hind feet; front and hind legs are swapped")
    aside = [np.median(np.sum((toes[:, one] - toes[:, other]) * left, axis=1)) for one, other in PAIRS]
    if max(aside) < 0.0:
        raise ClipError(f"{where}: the left feet are on the right; the file is mirrored, or its legs are misnamed")
    for (one, other), distance in zip(PAIRS, aside, strict=True):
        if distance < 0.0:
            names = [f"{LEG_NAMES[leg]}_toe" for leg in (one, other)]
            columns = [KEYPOINTS.index(name) for name in names]
            position = motion.position.copy()
            position[:, columns] = position[:, columns[::-1]]
            remark = f"{names[0]} and {names[1]} under each other's name in the whole file, put right"
            motion = replace(motion, position=position, remarks=(*motion.remarks, remark))
    return motion


def repaired(
    points: Array, names: Sequence[str], size: float, rate: float, where: str, shortest_jump: float = 0.0
) -> tuple[Array, tuple[str, ...]]:
    """Return points without short gaps, held frames, jumps and swapped sides, and remarks on what was done.

    Args:
        points: Trajectories [m], shape [num_frames, num_points, 3].
        names: Of the points.
        size: Length of the trunk [m].
        rate: Frames per second [Hz].
        where: The file, for messages.
        shortest_jump: A point that comes or goes by less than this from frame to frame has not jumped [m].

    Raises:
        ClipError: a gap is too long, or at an end of the file.
    """
    lost = ~np.isfinite(points).all(axis=-1)
    points, rested = without_rest_pose(points, size)
    faults = [("not finite", lost), ("all zeros", zeros(points, size))]
    points = filled(points, lost | faults[1][1], names, rate, where)
    points, swapped = unswapped(points, names, size)
    # One after the other: a jump out of a stance looks like the end of a hold.
    faults.append(("jumps", jumps(points, size, rate, shortest_jump)))
    points = filled(points, faults[-1][1], names, rate, where)
    faults.append(("held", held(points, size)))
    points = filled(points, faults[-1][1], names, rate, where)
    remarks = [
        f"{names[point]} {what} in {span(run.first, run.last)}, filled"
        for what, mask in faults
        for point in range(len(names))
        for run in intervals(mask[:, point])
    ]
    return points, shortened([*rested, *remarks, *swapped])


def without_rest_pose(points: Array, size: float) -> tuple[Array, list[str]]:
    """Return points without the pose in which a skeleton was bound, which some files have before their first frame.

    The animal is then somewhere else at once. The frames stay, so that ranges count as in the file, with the first real
    pose in them.
    """
    steps = np.nan_to_num(np.median(np.linalg.norm(np.diff(points[: 2 * REST_FRAMES + 2], axis=0), axis=-1), axis=1))
    for count in range(1, min(REST_FRAMES, len(steps) - 3) + 1):
        usual = max(np.median(steps[count:]), np.max(steps[: count - 1], initial=0.0))
        if steps[count - 1] > GLITCH_SIZE * size + GLITCH_RATIO * usual:
            points = points.copy()
            points[:count] = points[count]
            return points, [f"another pose in {span(0, count - 1)}, replaced by that of frame {count}"]
    return points, []


def shortened(remarks: list[str], most: int = 6) -> tuple[str, ...]:
    """Return the first remarks and the number of the others."""
    rest = [f"{len(remarks) - most} more of this kind"] if len(remarks) > most else []
    return (*remarks[:most], *rest)


def span(first: int, last: int) -> str:
    """Return a range of frames, both included, as text."""
    return f"frame {first}" if first == last else f"frames {first} to {last}"


def zeros(points: Array, size: float) -> Mask:
    """Return where a point is exactly (0, 0, 0), as capture systems write one that they do not see.

    A point that passes through the origin is near it in the frames beside.
    """
    mask = (points == 0.0).all(axis=-1)
    for point in np.flatnonzero(mask.any(axis=0)):
        for run in intervals(mask[:, point]):
            beside = [frame for frame in (run.first - 1, run.last + 1) if 0 <= frame < len(points)]
            near = [np.linalg.norm(points[frame, point]) < GLITCH_SIZE * size for frame in beside]
            if any(near):
                mask[run.first : run.last + 1, point] = False
    return mask


def held(points: Array, size: float) -> Mask:
    """Return where a point, or the whole frame, is the one before it while the animal moves.

    A foot that stands may be at exactly one place; a point that was held catches up with a larger step afterwards.
    """
    mask = np.zeros(points.shape[:2], dtype=bool)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=-1)
    same = steps == 0.0
    whole = same.all(axis=1)
    for run in intervals(whole):
        beside = [steps[frame].mean() for frame in (run.first - 1, run.last + 1) if 0 <= frame < len(steps)]
        if len(beside) == 2 and min(beside) > 1e-3 * size:
            mask[run.first + 1 : run.last + 2] = True
    for point in np.flatnonzero((same & ~whole[:, None]).any(axis=0)):
        for run in intervals(same[:, point]):
            before, after, later = run.first - 1, run.last + 1, run.last + 2
            if before < 0 or later >= len(steps) or run.last == run.first:
                continue
            usual = max(steps[before, point], steps[later, point])
            if steps[after, point] > CATCH_UP * usual + 0.005 * size and usual > 1e-3 * size:
                mask[run.first + 1 : run.last + 2, point] = True
    return mask


def jumps(points: Array, size: float, rate: float, shortest: float = 0.0) -> Mask:
    """Return where a point is elsewhere for a few frames and back again, faster than any animal moves.

    What a point is off the line between the frames beside is compared with how much its way bends just before and
    after. Nothing that comes or goes by less than ``shortest`` [m] is taken for a jump.
    """
    steps = np.linalg.norm(np.diff(points, axis=0), axis=-1)
    mask, frames, bend = np.zeros(points.shape[:2], dtype=bool), len(points), np.zeros(points.shape[:2])
    bend[1:-1] = np.linalg.norm(points[1:-1] - 0.5 * (points[2:] + points[:-2]), axis=-1)
    for width in range(1, max(min(GLITCH_FRAMES, int(LONGEST_GLITCH * rate)), 1) + 1):
        first = np.arange(1, frames - width)
        if len(first) == 0:
            break
        off = np.full((len(first), points.shape[1]), np.inf)
        for inside in range(width):
            share = (inside + 1.0) / (width + 1.0)
            line = (1.0 - share) * points[first - 1] + share * points[first + width]
            off = np.minimum(off, np.linalg.norm(points[first + inside] - line, axis=-1))
        far = (off > GLITCH_SIZE * size) & (np.minimum(steps[first - 1], steps[first + width - 1]) >= shortest)
        if not far.any():
            continue
        beside = np.zeros_like(off)
        for distance in (2, 3):
            beside = np.maximum(beside, bend[np.maximum(first - distance, 0)])
            beside = np.maximum(beside, bend[np.minimum(first + width - 1 + distance, frames - 1)])
        found = far & (off > GLITCH_RATIO * (width**2 * beside + 0.01 * size))
        for inside in range(width):
            mask[first + inside] |= found
    return mask


def unswapped(points: Array, names: Sequence[str], size: float) -> tuple[Array, list[str]]:
    """Return points with the names of left and right put right where two points change places for a while."""
    points, remarks = points.copy(), []
    for index, name in enumerate(names):
        other = re.sub(r"([FRH])L", r"\1R", name)
        if other == name or other not in names:
            continue
        pair = [index, list(names).index(other)]
        a, b = points[:, pair[0]], points[:, pair[1]]
        kept = np.linalg.norm(np.diff(a, axis=0), axis=1) + np.linalg.norm(np.diff(b, axis=0), axis=1)
        crossed = np.linalg.norm(a[1:] - b[:-1], axis=1) + np.linalg.norm(b[1:] - a[:-1], axis=1)
        changes = np.flatnonzero((crossed < 0.4 * kept) & (kept > 4.0 * GLITCH_SIZE * size)) + 1
        if len(changes) < 2:
            continue
        for first, end in zip(changes[::2], changes[1::2], strict=False):
            points[first:end, pair] = points[first:end, pair[::-1]]
            remarks.append(f"{name} and {other} swapped in {span(first, end - 1)}, put right")
    return points, remarks


def filled(points: Array, missing: Mask, names: Sequence[str], rate: float, where: str) -> Array:
    """Return points with gaps bridged by a curve that keeps the shape of what is beside.

    Raises:
        ClipError: a gap is longer than ``LONGEST_GAP``, or at an end of the file.
    """
    if not missing.any():
        return points
    points, frames = points.copy(), np.arange(len(points))
    for point in np.flatnonzero(missing.any(axis=0)):
        for run in intervals(missing[:, point]):
            at_end = run.first == 0 or run.last == len(points) - 1
            if at_end or run.last - run.first + 1 > LONGEST_GAP * rate * (1.0 + 1e-6):
                kind = "at an end of the file" if at_end else f"longer than {LONGEST_GAP} s"
                raise ClipError(
                    f"{where}, {span(run.first, run.last)}: {names[point]} was lost there, a gap {kind}; "
                    "mend the file or cut these frames off"
                )
        good = ~missing[:, point]
        if good.sum() < 2:
            raise ClipError(f"{where}: {names[point]} was lost in nearly every frame")
        curve = PchipInterpolator(frames[good], points[good, point])
        points[~good, point] = curve(frames[~good])
    return points
