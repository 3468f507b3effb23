"""What a range of a recording shows: speed, turn rate, when feet stand and touch down; and the label that follows.

Footfalls are judged as Hildebrand did (Symmetrical gaits of horses, Science 150, 1965): by the share of the stride that
a foot stands (duty factor) and the share by which a forefoot touches down after the hind foot of its side.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.motions.discovery.recording import Recording, tilt
from kine2go_warp.motions.stance import intervals
from kine2go_warp.rotations import turn_planar

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Kind = Literal["cycle", "once", "still"]
Label = Literal[
    "walk", "trot", "pace", "canter", "gallop", "bound", "turn", "strafe", "sit", "lie", "rise", "jump", "stand"
]

ALTERNATING = 0.35
"""The feet of a pair alternate if their touch-downs are at least this share of a stride apart, of half a stride."""
TOGETHER = 0.125
"""Touch-downs closer than this share of a stride are one beat: an eighth, as in Hildebrand's classes."""
WALKING_DUTY = 0.65
"""A symmetrical gait whose feet stand for longer is a walk, whichever of them touch down together."""
LEAPING_DUTY = 0.55
"""In a canter and a gallop feet stand for less; an animal whose steps are uneven stands for longer."""
BOUNDING = 0.08
"""The same for both feet of a pair, which in a gallop touch down soon after each other."""
STANDING_SPEED, STANDING_TURN = 0.08, 0.3
"""Slower than this [m/s], [rad/s] an animal steps on the spot."""
TURN_RATE, TURN_RADIUS = 0.7, 0.75
"""A turn is at least this fast [rad/s], along a circle of at most this radius [m]."""
STRAFE_SHARE, STRAFE_SPEED = 0.6, 0.12
"""A strafe leads sideways by this share of its way along the heading, at this speed at least [m/s]."""
ONCE_TURN = 0.6
"""A motion that is played once is a turn if it turns by this [rad]."""
JUMP_RISE = 0.03
"""In a jump the base rises by this while no foot stands [m]; a body that falls freely takes 0.16 s for it."""


@dataclass(frozen=True)
class GaitMeasures:
    """Figures of one range, in the robot's size."""

    speed: float
    """Mean speed along the heading [m/s]; negative for going backwards."""
    sideways: float
    """Mean speed to the left [m/s]."""
    turn_rate: float
    """Mean yaw rate, positive to the left [rad/s]."""
    duration: float
    """Of the range [s]."""
    strides: int
    """How often the feet touch down, by their median."""
    duty: tuple[float, ...]
    """Share of the range that FL, FR, RL, RR stand."""
    phase: tuple[float, ...]
    """Touch-down of FL, FR, RL, RR in the stride, RL's at 0; NaN where a foot never touches down."""
    flight: float
    """Share of the range that no foot stands."""
    turn: float
    """From first to last frame [rad]."""
    rise: float
    """How far the base rises in a flight, over take-off and landing [m]; 0 without any."""
    postures: tuple[str, str]
    """In the first and in the last frame."""

    @property
    def is_stride(self) -> bool:
        """Whether every foot stands and swings."""
        return self.strides > 0 and bool(np.isfinite(self.phase).all())

    @property
    def side(self) -> str:
        """``left`` or ``right`` of a turn or a strafe."""
        leading = self.turn_rate if abs(self.turn_rate) * TURN_RADIUS > abs(self.sideways) else self.sideways
        return "left" if leading > 0.0 else "right"

    def lag(self, later: int, earlier: int) -> float:
        """Return by which share of a stride one foot touches down after another, in [-0.5, 0.5)."""
        return (self.phase[later] - self.phase[earlier] + 0.5) % 1.0 - 0.5


def measure_gait(recording: Recording, start: int, end: int, is_cycle: bool) -> GaitMeasures:
    """Return what the frames ``start`` to ``end`` (exclusive) show.

    Args:
        recording: The recording.
        start: First frame.
        end: The frame after the last.
        is_cycle: Whether the last frame is followed by the first one.
    """
    chosen = slice(start, end)
    stance, velocity = recording.stance[chosen], recording.velocity[chosen]
    duration = (end - start) / recording.rate
    turn = float(recording.yaw[min(end, len(recording.yaw) - 1)] - recording.yaw[start])
    phase, strides = touch_down_phases(stance, is_cycle)
    return GaitMeasures(
        speed=float(velocity[:, 0].mean()),
        sideways=float(velocity[:, 1].mean()),
        turn_rate=turn / duration,
        duration=duration,
        strides=strides,
        duty=tuple(float(share) for share in stance.mean(axis=0)),
        phase=phase,
        flight=float(np.mean(~stance.any(axis=1))),
        turn=turn,
        rise=flight_rise(stance, recording.targets.root_position[chosen, 2]),
        postures=(str(recording.posture[start]), str(recording.posture[end - 1])),
    )


def touch_down_phases(stance: Mask, is_cycle: bool) -> tuple[tuple[float, ...], int]:
    """Return the phase of each foot's touch-downs, and the number of strides in the range.

    Where a range has several strides, a phase is the mean direction of all touch-downs on the circle of one stride.
    """
    before = np.roll(stance, 1, axis=0)
    if not is_cycle:
        before[0] = stance[0]
    frames = [np.flatnonzero(down) for down in (stance & ~before).T]
    strides = int(np.median([len(one) for one in frames]))
    if strides == 0:
        return (float("nan"),) * 4, 0
    angles = [np.exp(2j * np.pi * strides * one / len(stance)).sum() for one in frames]
    phases = np.array([np.angle(one) / (2.0 * np.pi) if abs(one) > 1e-9 else np.nan for one in angles])
    return tuple(float(one) for one in (phases - phases[2]) % 1.0), strides


def flight_rise(stance: Mask, height: Array) -> float:
    """Return how far the base rises at most while no foot stands, over take-off and landing [m]."""
    flights = [height[max(run.first - 1, 0) : run.last + 2] for run in intervals(np.max(stance, axis=1) < 1)]
    return max((float(one.max() - max(one[0], one[-1])) for one in flights), default=0.0)


def label_of(kind: Kind, gait: GaitMeasures) -> Label:
    """Return the label of a range."""
    if kind == "cycle":
        return cycle_label(gait)
    first, last = gait.postures
    if kind == "once" and first == last == "up":
        return passing_label(gait)
    held: dict[str, Label] = {"up": "stand" if kind == "still" else "rise", "sit": "sit", "lie": "lie"}
    return held[last]


def cycle_label(gait: GaitMeasures) -> Label:
    """Return the label of a motion that repeats itself."""
    way = float(np.hypot(gait.speed, gait.sideways))
    if way < STANDING_SPEED and abs(gait.turn_rate) < STANDING_TURN:
        return "stand"
    if abs(gait.turn_rate) > TURN_RATE and way < TURN_RADIUS * abs(gait.turn_rate):
        return "turn"
    return "strafe" if strafes(gait) else footfall_label(gait)


def passing_label(gait: GaitMeasures) -> Label:
    """Return the label of a motion from standing to standing that is played once."""
    if gait.rise >= JUMP_RISE:
        return "jump"
    if abs(gait.turn) > ONCE_TURN:
        return "turn"
    return "strafe" if strafes(gait) else "walk"


def strafes(gait: GaitMeasures) -> bool:
    """Return whether a range leads sideways."""
    return abs(gait.sideways) > max(STRAFE_SPEED, STRAFE_SHARE * abs(gait.speed))


def footfall_label(gait: GaitMeasures) -> Label:
    """Return the gait that the order of touch-downs and the duty factors tell."""
    duty = float(np.mean(gait.duty))
    fore, hind = abs(gait.lag(1, 0)), abs(gait.lag(3, 2))
    if min(fore, hind) >= ALTERNATING:
        sides = np.exp(2j * np.pi * np.array([gait.lag(0, 2), gait.lag(1, 3)]))
        side = abs(float(np.angle(sides.sum()))) / (2.0 * np.pi)
        if duty > WALKING_DUTY or (duty >= 0.5 and TOGETHER < side < 0.5 - TOGETHER):
            return "walk"
        return "pace" if side < 0.25 else "trot"
    if max(fore, hind) < BOUNDING:
        return "jump" if abs(gait.lag(0, 2)) < BOUNDING else "bound"
    if duty > LEAPING_DUTY:
        return "walk"
    return "canter" if min(abs(gait.lag(0, 3)), abs(gait.lag(1, 2))) < TOGETHER else "gallop"


def shape_of(recording: Recording, start: int, end: int, count: int) -> Array:
    """Return feet as seen from the base, its height and its tilt at some moments of a range [m], shape [count, 15].

    Tilts are given as what they move at the end of a lever of 0.2 m, half the robot's trunk.
    """
    places = start + (end - start) * np.arange(count) / count
    poses = recording.targets
    assert poses.feet is not None
    index = np.minimum(np.round(places).astype(int), len(poses) - 1)
    offset = poses.feet[index] - poses.root_position[index, None] * [1.0, 1.0, 0.0]
    feet = turn_planar(offset, -recording.yaw[index, None])
    return np.hstack([feet.reshape(count, -1), poses.root_position[index, 2:], 0.2 * tilt(poses.taken(index))])
