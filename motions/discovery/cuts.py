"""Cutting a recording into cycles, motions that are played once, and stillness."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d

from kine2go_warp.motions.clip import Kind as ClipKind
from kine2go_warp.motions.config import LEAST_WAY, RetargetConfig, TimeScale
from kine2go_warp.motions.cycle_search import best_ends, cycle_frames, find_cycles, pose_features, seam_scores
from kine2go_warp.motions.discovery.gaits import (
    JUMP_RISE,
    GaitMeasures,
    Kind,
    Label,
    flight_rise,
    label_of,
    measure_gait,
)
from kine2go_warp.motions.discovery.recording import Recording
from kine2go_warp.motions.quality import LARGEST_LEAN, distance_to_hull
from kine2go_warp.motions.stance import Interval, intervals

SETTLING = 5
"""How often the ends of a cycle are moved to a better seam before they are taken as they are."""
MOST_SEAM = 1.0
"""A range whose seam scores worse does not repeat itself, as the report of retargeting says."""
STILL_TIMES = (1.0, 2.0)
"""Stillness is a motion of its own from this time on, and is cut to the other [s]."""
HOLD = 0.25
"""A pose is held if the animal is still for this long [s]; so much of it stays at either end of a motion."""
MOST_FILLED = 0.5
"""A range of several strides is left out if single strides fill this share of it."""
FIRM_FEET, FIRM_FRAMES = 3, 3
"""So many feet must stand, for so many frames, where a motion may begin or end."""
CHANGE_TIME = 2.0
"""Longest change of posture [s]; an animal that is not to be stopped any sooner does something else by then."""
ONCE_TIMES = (0.6, 8.0)
"""Shortest and longest motion that is played once [s]."""


Array = NDArray[np.float64]


@dataclass(frozen=True)
class Cut:
    """A range of a recording with its label."""

    recording: Recording = field(repr=False)
    kind: Kind
    start: int
    end: int
    """Exclusive."""
    seam: float
    """Distance of the ends of a cycle, in standard deviations of the recording; else 0."""
    gait: GaitMeasures
    label: Label

    @property
    def clip_kind(self) -> ClipKind:
        """The kind of the clip that is made of it; stillness needs no seam."""
        return "cycle" if self.kind == "cycle" else "once"

    @property
    def time_scale(self) -> TimeScale | None:
        """That of the clip: in a jump a robot of another size falls for as long as gravity has it."""
        return "froude" if self.label == "jump" else None

    @property
    def name(self) -> str:
        """File, label, side and first frame, as a name of a motion."""
        from kine2go_warp.motions.own_file import name_of

        sided = self.label in ("turn", "strafe")
        side = f"_{self.gait.side}" if sided else "_back" if self.gait.speed < -0.1 and self.kind == "cycle" else ""
        return f"{name_of(self.recording.path)}_{self.label}{side}_{self.start}"


def cut(recording: Recording, kind: Kind, start: int, end: int, seam: float = 0.0) -> Cut:
    """Return a range with its figures and its label."""
    gait = measure_gait(recording, start, end, kind == "cycle")
    return Cut(recording, kind, start, end, seam, gait, label_of(kind, gait))


def cuts(recording: Recording) -> list[Cut]:
    """Return all that a recording holds, best seam first among the cycles, then what is played once, then stillness."""
    return [*cycles(recording), *once(recording), *stillness(recording)]


def cycles(recording: Recording) -> list[Cut]:
    """Return the ranges that repeat themselves while the animal is up and moves, best seam first.

    In each every foot stands and swings. One of several strides is left out where single strides fill most of it.
    """
    features = pose_features(recording.targets)
    reach = round(RetargetConfig().search_time * recording.rate)
    ranges = set()
    for one in find_cycles(recording.targets, *cycle_frames(recording.rate), len(features), LEAST_WAY):
        inside = slice(one.start, one.end)
        if one.score <= MOST_SEAM and np.all(recording.posture[inside] == "up") and not recording.still[inside].all():
            ranges.add(settled(features, one.start, one.end, reach))
    found = []
    for start, end in ranges:
        seam = seam_scores(features, np.array([start]), np.array([end]))
        found.append(cut(recording, "cycle", start, end, float(seam[0, 0])))
    strides = [one for one in found if one.gait.is_stride and one.seam <= MOST_SEAM]
    filled = np.zeros(len(features) + 1, dtype=bool)
    for one in strides:
        if one.gait.strides == 1:
            filled[one.start : one.end] = True
    kept = [one for one in strides if one.gait.strides == 1 or filled[one.start : one.end].mean() < MOST_FILLED]
    return sorted(kept, key=lambda one: one.seam)


def settled(features: Array, start: int, end: int, reach: int) -> tuple[int, int]:
    """Return the ends that the retargeting will not move, so that a label is of the frames that are used."""
    for _ in range(SETTLING):
        better = best_ends(features, start, end, reach)
        if better == (start, end):
            break
        start, end = better
    return start, end


def stillness(recording: Recording) -> list[Cut]:
    """Return the ranges in which the animal is still, from their middle."""
    least, most = (round(time * recording.rate) for time in STILL_TIMES)
    found = []
    for run in intervals(recording.still):
        length = min(run.last + 1 - run.first, most)
        if length >= least:
            start = run.first + (run.last + 1 - run.first - length) // 2
            found.append(cut(recording, "still", start, start + length))
    return found


def once(recording: Recording) -> list[Cut]:
    """Return the motions between two poses that can be held: jumps, changes of posture, then all between two holds."""
    shortest, longest = (time * recording.rate for time in ONCE_TIMES)
    hold = round(HOLD * recording.rate)
    held = [run for run in intervals(recording.still) if run.last + 1 - run.first >= hold]
    up = recording.posture == "up"
    firm = firm_frames(recording, hold)
    changes = posture_changes(up, firm, held, hold)
    ranges = [*jumps(recording, firm), *(one for one in changes if one[1] - one[0] <= CHANGE_TIME * recording.rate)]
    ranges += [(before.last + 1 - hold, after.first + hold) for before, after in pairwise(held)]
    return [
        cut(recording, "once", start, end) for start, end in dict.fromkeys(ranges) if shortest <= end - start <= longest
    ]


def firm_frames(recording: Recording, hold: int) -> NDArray[np.int_]:
    """Return the frames at which an animal can be stopped: up for a hold before and after, and borne by its feet."""
    up = minimum_filter1d((recording.posture == "up").astype(int), 2 * hold + 1, mode="nearest")
    stance = minimum_filter1d(recording.stance.astype(int), FIRM_FRAMES, axis=0, mode="nearest") > 0
    feet, base = recording.targets.feet, recording.targets.root_position
    assert feet is not None
    some = np.flatnonzero((up > 0) & (stance.sum(axis=1) >= FIRM_FEET))
    lean = [distance_to_hull(feet[frame, stance[frame], :2] - base[frame, :2]) for frame in some]
    return some[np.array(lean, dtype=float) <= LARGEST_LEAN]


def jumps(recording: Recording, firm: NDArray[np.int_]) -> Iterator[tuple[int, int]]:
    """Yield the ranges around each jump, from and to a frame at which the animal stands firmly."""
    height, stance = recording.targets.root_position[:, 2], recording.stance
    for run in intervals(np.max(stance, axis=1) < 1):
        near = slice(max(run.first - 1, 0), run.last + 2)
        before, after = firm[firm < run.first], firm[firm > run.last]
        if flight_rise(stance[near], height[near]) >= JUMP_RISE and len(before) and len(after):
            yield int(before[-1]), int(after[0]) + 1


def posture_changes(
    up: NDArray[np.bool_], firm: NDArray[np.int_], held: list[Interval], hold: int
) -> Iterator[tuple[int, int]]:
    """Yield the ranges in which an animal goes down or gets up, from or to a pose that is held low.

    Args:
        up: Whether it is up, shape [num_frames].
        firm: Frames at which it stands firmly; the nearest one is the other end of a range.
        held: Where it is still.
        hold: So much of a held pose stays in the range [frames].
    """
    for run in held:
        if up[run.first] or up[run.last]:
            continue
        after, before = firm[firm > run.last], firm[firm < run.first]
        if len(after) and not any(run.last < other.first < after[0] for other in held):
            yield run.last + 1 - hold, int(after[0]) + 1
        if len(before) and not any(before[-1] < other.first < run.first for other in held):
            yield int(before[-1]), run.first + hold
