"""How truly a clip moves as the animal does, measured by other rules than those that made the clip.

Contacts are found here by speed alone, in the source and in the clip alike; the feet of a clip are held by labels that
follow height and speed (``stance.py``). Pitch is that of the line from the middle of the hips to the middle of the
shoulders; the base of a clip follows pelvis and neck (``targets.py``).
"""

from dataclasses import asdict, dataclass, field, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from kine2go_warp.motions.keypoints import KeypointMotion
from kine2go_warp.robots import RobotSpec
from kine2go_warp.robots.kinematics import contact_velocity, foot_positions, shank_rotations
from kine2go_warp.rotations import to_rotation, turn_between, turn_planar

if TYPE_CHECKING:
    from kine2go_warp.motions.clip import MotionClip

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

CONTEXT = 1.0
"""How far beyond its range a motion is looked at, so that no contact is cut [s]."""
SLOW_SHARE = 0.25
"""A foot slower than this share of its greatest speed nearby stands."""
NEARBY = 0.6
"""How far on either side its greatest speed is looked for [s]."""
SLOWEST_SWING = 0.4
"""Where a foot is never faster than this, it stands [m/s]."""
CAPTURE_FILTER = 0.015
"""Standard deviation of the filter on the source's points before they are differentiated [s]."""
TRUNK_FILTER = 0.02
"""The same for accelerations of the animal's trunk [s]."""
LOW = 0.003
"""A foot whose sphere is lower than this touches the floor [m]."""
NEAR_LOWEST, LOWEST_SHARE = 0.01, 0.05
"""A foot this near to its lowest stands; a few frames may be lower still [m, 1]."""
SEAM_REACH = 0.1
"""Accelerations this near to the seam are those of the seam [s]."""
SHORTEST_STRIDE, LONGEST_STRIDE = 0.25, 1.6
"""Among these the stride of an animal is looked for [s]."""
APART = 0.7
"""Legs that differ by less than this many standard deviations agree."""
HIGH_FREQUENCY = 15.0
"""[Hz]"""


def _metric(unit: str, meaning: str, **more: Any) -> Any:
    """Return a field with what a dataset says of it."""
    return field(metadata={"units": unit, "description": meaning}, **more)


def _later(unit: str, meaning: str) -> Any:
    """Return a field that clips of earlier versions do not have."""
    return _metric(unit, meaning, default=float("nan"))


@dataclass(frozen=True)
class Fidelity:
    """Figures of one clip against its source. NaN where a figure has no meaning, such as a flight that never is."""

    trunk_pitch: float = _metric(
        "deg",
        "pitch of the base less that of the line from hips to shoulders, mean over the frames; nose-up is positive",
    )
    swing_front: float = _metric("1", "median over swings of the fore feet's greatest height over the animal's, scaled")
    swing_hind: float = _metric("1", "median over swings of the hind feet's greatest height over the animal's, scaled")
    duty: float = _metric("1", "share of time that feet stand, less the animal's, mean over the feet")
    height_correlation: float = _metric(
        "1", "correlation of the base's height with that of the middle of the animal's trunk"
    )
    base_dip: float = _metric("m", "how far the base sinks below the animal's trunk, from their median distance")
    seam_acceleration: float = _metric("m/s^2", "greatest horizontal acceleration of the base within 0.1 s of the seam")
    other_acceleration: float = _metric("m/s^2", "99th percentile of the base's horizontal acceleration elsewhere")
    animal_acceleration: float = _metric(
        "m/s^2",
        "greatest horizontal acceleration of the animal's trunk within 0.1 s "
        "of the ends of the range, in the clip's time",
    )
    seam_shift: float = _metric(
        "1", "share of a stride by which the animal's legs at the end of the range are off those at its beginning"
    )
    contact_slip: float = _metric("m/s", "mean horizontal speed of the lowest point of a foot that is lower than 3 mm")
    contact_slip_95: float = _metric("m/s", "95th percentile of the same speed")
    penetration: float = _metric("m", "deepest that any foot is below the floor")
    knee_bent_margin: float = _metric("rad", "least distance of a knee from its limit when it folds")
    knee_straight_margin: float = _metric("rad", "least distance of a knee from its limit when it straightens")
    high_frequency: float = _metric("1", "share of the energy of the joints' velocities above 15 Hz")
    flight_acceleration: float = _metric(
        "m/s^2", "mean vertical acceleration of the base while no foot stands; -9.81 for a body that flies"
    )
    flight_share: float = _metric("1", "share of time that no foot stands")
    source_standing_speed: float = _later(
        "m/s", "median horizontal speed of the source's toes while they are within 10 mm of their lowest, scaled"
    )
    standing_speed: float = _later("m/s", "the same of the centres of the robot's feet, in the source's time")
    source_penetration: float = _later(
        "m", "deepest that a foot of the source is below the floor, where the source is a robot's motion"
    )

    def as_json(self) -> dict[str, float | None]:
        """Return the metrics by name, with null for what has no meaning."""
        return {name: None if np.isnan(value) else value for name, value in asdict(self).items()}

    def described(self) -> dict[str, dict[str, Any]]:
        """Return value, units and description of each metric by name, as a dataset keeps them."""
        values = self.as_json()
        return {one.name: {"value": values[one.name], **one.metadata} for one in fields(self)}

    @classmethod
    def from_json(cls, content: dict[str, Any] | None) -> "Fidelity | None":
        """Undo ``as_json``; None if there is nothing."""
        if content is None:
            return None
        return cls(**{name: float("nan") if value is None else float(value) for name, value in content.items()})


def measure(
    clip: "MotionClip", motion: KeypointMotion, spec: RobotSpec, frames: tuple[int, int] | None = None
) -> Fidelity:
    """Return the figures of a clip; those of a seam are NaN if it is played once.

    Args:
        clip: The clip.
        motion: The whole motion, scaled to the robot's size.
        spec: The robot.
        frames: Of the motion, first and the one after the last, that the clip was made from; by default its origin's.
    """
    start, end = frames or (clip.origin.start, clip.origin.end)
    step = 1.0 / motion.rate
    margin = round(CONTEXT / step)
    before = min(margin, start)
    near = motion.frames(start - before, min(end + margin, motion.num_frames))
    within = slice(before, before + end - start)
    toes = near.points("toe")
    contact = contacts_by_speed(gaussian_filter1d(toes, CAPTURE_FILTER / step, axis=0), step)[within]
    poses = clip.extended(margin, margin)
    assert poses.joints is not None
    rotation = to_rotation(poses.root_orientation).as_matrix()
    feet = np.einsum("tij,tkj->tki", rotation, foot_positions(spec, poses.joints)) + poses.root_position[:, None]
    middle = slice(margin, margin + clip.num_frames)
    # Time runs as in the source, so that a clip that was slowed is compared like for like.
    clip_contact = contacts_by_speed(feet, step)[middle]
    bottom = feet[middle, :, 2] - spec.foot_radius
    front, hind = (
        swing_share(bottom[:, legs], toes[within][:, legs, 2], contact[:, legs]) for legs in ([0, 1], [2, 3])
    )
    trunk = 0.5 * (near.point("pelvis") + near.point("neck"))
    slip = floor_speeds(clip, feet[margin - 1 : margin + clip.num_frames + 1], rotation, poses.joints, margin, spec)
    accelerations = horizontal_acceleration(poses.root_position, clip.frame_duration)[middle]
    at_seam = near_seam(clip.num_frames, clip.frame_duration) & (clip.cycle is not None)
    knees = clip.joint_position[:, 2::3]
    flying = np.all(~clip_contact, axis=1)
    return Fidelity(
        trunk_pitch=float(np.mean(base_pitch(clip) - trunk_pitch(near.frames(within.start, within.stop)))),
        swing_front=front,
        swing_hind=hind,
        duty=float(clip_contact.mean() - contact.mean()),
        height_correlation=correlation(clip.root_position[:, 2], trunk[within, 2]),
        base_dip=dip(clip.root_position[:, 2], trunk[within, 2]),
        seam_acceleration=float(accelerations[at_seam].max()) if at_seam.any() else float("nan"),
        other_acceleration=float(np.quantile(accelerations[~at_seam], 0.99)) if np.any(~at_seam) else float("nan"),
        animal_acceleration=nan_if_once(clip, animal_acceleration(trunk, within, step))
        * (step / clip.frame_duration) ** 2,
        seam_shift=nan_if_once(clip, seam_shift(near, before, before + end - start)),
        contact_slip=float(slip.mean()) if slip.size else 0.0,
        contact_slip_95=float(np.quantile(slip, 0.95)) if slip.size else 0.0,
        penetration=float(max(-bottom.min(), 0.0)),
        knee_bent_margin=float(knees.min() - spec.joint_lower[2]),
        knee_straight_margin=float(spec.joint_upper[2] - knees.max()),
        high_frequency=high_frequency_share(clip.joint_velocity, clip.frame_duration),
        flight_acceleration=flight_acceleration(poses.root_position[:, 2], flying, margin, clip.frame_duration),
        flight_share=float(flying.mean()),
        source_standing_speed=standing_speed(toes[within], step),
        standing_speed=standing_speed(feet[middle], step),
        source_penetration=float(np.maximum(motion.foot_radius - toes[within][..., 2].min(), 0.0)),
    )


def nan_if_once(clip: "MotionClip", value: float) -> float:
    """Return a figure of the seam, or NaN for a clip that has none."""
    return value if clip.cycle is not None else float("nan")


def contacts_by_speed(points: Array, step: float) -> Mask:
    """Return whether each foot stands, by its speed in space alone, shape [num_frames, 4].

    Args:
        points: Toes or foot centres [m], shape [num_frames, 4, 3].
        step: From frame to frame [s].
    """
    speed = np.linalg.norm(np.gradient(points, step, axis=0), axis=-1)
    fastest = maximum_filter1d(speed, 2 * round(NEARBY / step) + 1, axis=0, mode="nearest")
    return speed < SLOW_SHARE * np.maximum(fastest, SLOWEST_SWING)


def standing_speed(points: Array, step: float) -> float:
    """Return the median horizontal speed of feet while each is within ``NEAR_LOWEST`` of its lowest [m/s].

    Args:
        points: Toes or foot centres [m], shape [num_frames, 4, 3].
        step: From frame to frame [s].
    """
    speed = np.linalg.norm(np.gradient(points[..., :2], step, axis=0), axis=-1)
    lowest = np.quantile(points[..., 2], LOWEST_SHARE, axis=0)
    return float(np.median(speed[points[..., 2] <= lowest + NEAR_LOWEST]))


def swing_share(bottom: Array, toes: Array, contact: Mask) -> float:
    """Return the median greatest height of the robot's feet in a swing over that of the animal's.

    The swings are the animal's; heights are over the floor, for the animal over its standing toes.

    Args:
        bottom: Lowest points of the robot's feet [m], shape [num_frames, num_feet].
        toes: Heights of the animal's toes [m], the same shape.
        contact: Whether the animal's feet stand, the same shape.
    """
    ours, theirs = [], []
    for foot in range(toes.shape[1]):
        if contact[:, foot].all() or not contact[:, foot].any():
            continue
        above = toes[:, foot] - np.median(toes[contact[:, foot], foot])
        edges = np.flatnonzero(np.diff(contact[:, foot].astype(int)))
        # The first and the last swing may be cut by the ends of the range.
        for first, last in zip(edges[:-1] + 1, edges[1:] + 1, strict=True):
            if not contact[first, foot]:
                ours.append(bottom[first:last, foot].max())
                theirs.append(above[first:last].max())
        cut = ~contact[:, foot]
        if len(edges) <= 2 and cut.any():
            ours.append(bottom[cut, foot].max())
            theirs.append(above[cut].max())
    high = np.array(theirs) > 0.25 * np.quantile(theirs, 0.9) if theirs else np.zeros(0, dtype=bool)
    return float(np.median(np.array(ours)[high]) / np.median(np.array(theirs)[high])) if high.any() else float("nan")


def trunk_pitch(motion: KeypointMotion) -> Array:
    """Return the pitch of the line from the middle of the hips to that of the shoulders, nose-up [deg]."""
    hips = motion.points("hip")
    return pitch_of(hips[:, :2].mean(axis=1) - hips[:, 2:].mean(axis=1))


def base_pitch(clip: "MotionClip") -> Array:
    """Return the pitch of a clip's base, nose-up [deg]."""
    return pitch_of(to_rotation(clip.root_orientation).apply([1.0, 0.0, 0.0]))


def pitch_of(forward: Array) -> Array:
    """Return the pitch of directions [deg]."""
    return np.degrees(np.arctan2(forward[:, 2], np.linalg.norm(forward[:, :2], axis=1)))


def correlation(ours: Array, theirs: Array) -> float:
    """Return the correlation of two series; NaN where one of them never changes."""
    if min(ours.std(), theirs.std()) < 1e-5:
        return float("nan")
    return float(np.corrcoef(ours, theirs)[0, 1])


def dip(ours: Array, theirs: Array) -> float:
    """Return how far one height sinks below the other, from their median distance [m]."""
    apart = ours - theirs
    return float(np.median(apart) - apart.min())


def horizontal_acceleration(position: Array, step: float) -> Array:
    """Return horizontal accelerations by second differences [m/s^2]; the first and the last are 0."""
    second = np.zeros(len(position))
    second[1:-1] = np.linalg.norm(np.diff(position[:, :2], 2, axis=0), axis=1) / step**2
    return second


def near_seam(num_frames: int, step: float) -> Mask:
    """Return which frames of a cycle lie next to its seam."""
    frames = np.arange(num_frames)
    return np.minimum(frames, num_frames - frames) * step <= SEAM_REACH


def animal_acceleration(trunk: Array, within: slice, step: float) -> float:
    """Return the greatest horizontal acceleration of a trunk next to the two ends of a range [m/s^2]."""
    found = horizontal_acceleration(gaussian_filter1d(trunk, TRUNK_FILTER / step, axis=0, mode="nearest"), step)
    # At its ends the filter invents a stop.
    found[: round(3.0 * TRUNK_FILTER / step)] = found[-round(3.0 * TRUNK_FILTER / step) :] = 0.0
    reach = round(SEAM_REACH / step)
    return float(
        max(found[max(place - reach, 0) : place + reach + 1].max(initial=0.0) for place in (within.start, within.stop))
    )


def seam_shift(motion: KeypointMotion, start: int, end: int) -> float:
    """Return by what share of a stride the legs at ``end`` are behind or before those at ``start``.

    Legs are compared by how far and how high the toes are from their hips and by how these change. The share is 0 where
    the legs agree, and where no other frame within half a stride agrees clearly better.
    """
    reach = motion.points("toe") - motion.points("hip")
    trunk = motion.point("neck") - motion.point("pelvis")
    ahead = turn_planar(reach, -np.arctan2(trunk[:, 1], trunk[:, 0])[:, None])[..., [0, 2]]
    features = np.concatenate([ahead, np.gradient(ahead, axis=0)], axis=-1)
    features = (features / np.maximum(features.std(axis=(0, 1)), 1e-6)).reshape(len(features), -1)
    lags = np.arange(round(SHORTEST_STRIDE * motion.rate), min(round(LONGEST_STRIDE * motion.rate), end - start))
    if len(lags) == 0:
        return 0.0
    changes = [np.mean((features[start + lag : end] - features[start : end - lag]) ** 2) for lag in lags]
    stride = int(lags[np.argmin(changes)])
    last = min(end, len(features) - 1)
    near = np.arange(max(last - stride, start), min(last + stride // 2, len(features) - 1) + 1)
    apart = np.sqrt(np.mean((features[near] - features[start]) ** 2, axis=1))
    here = float(apart[near == last][0])
    if here < APART or apart.min() > 0.5 * here:
        return 0.0
    shift = (near[np.argmin(apart)] - last) / stride
    return float(shift - round(shift))


def floor_speeds(
    clip: "MotionClip", feet: Array, rotation: Array, joints: Array, margin: int, spec: RobotSpec
) -> Array:
    """Return the horizontal speeds of the lowest points of all feet that touch the floor [m/s], in one row."""
    around = slice(margin - 1, margin + clip.num_frames + 1)
    shanks = rotation[around, None] @ shank_rotations(spec, joints[around])
    turns = turn_between(shanks[:-2], shanks[2:]) / (2.0 * clip.frame_duration)
    velocity = (feet[2:] - feet[:-2]) / (2.0 * clip.frame_duration)
    speed = np.linalg.norm(contact_velocity(velocity, turns, spec.foot_radius)[..., :2], axis=-1)
    low = feet[..., 2] - spec.foot_radius < LOW
    # Differences reach over three frames; a foot that touches down in one of them moves.
    return speed[low[2:] & low[1:-1] & low[:-2]]


def high_frequency_share(velocity: Array, step: float) -> float:
    """Return the share of energy above 15 Hz of periodic velocities, shape [num_frames, 12]."""
    power = np.abs(np.fft.rfft(velocity, axis=0)) ** 2
    high = np.fft.rfftfreq(len(velocity), step) > HIGH_FREQUENCY
    return float(power[high].sum() / max(power.sum(), 1e-12))


def flight_acceleration(height: Array, flying: Mask, margin: int, step: float) -> float:
    """Return the mean vertical acceleration while no foot stands, frames beside a contact left out [m/s^2]."""
    second = np.diff(height, 2)[margin - 1 : margin - 1 + len(flying)] / step**2
    inside = flying & np.roll(flying, 1) & np.roll(flying, -1)
    return float(second[inside].mean()) if inside.any() else float("nan")
