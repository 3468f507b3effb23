"""How good a reference clip is, in figures that a robot cares about."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from kine2go_warp.motions.body import lowest_body_point
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.motions.fidelity import Fidelity
from kine2go_warp.motions.retarget import Retargeted
from kine2go_warp.robots import RobotSpec
from kine2go_warp.robots.kinematics import foot_positions
from kine2go_warp.rotations import to_rotation

Array = NDArray[np.float64]


LARGEST_JUMP = 1.5
"""A seam may be this many normal steps wide."""
SHORTEST_CYCLE = 0.25
"""A cycle that is shorter holds no stride [s]."""
SHORTEST_WAY = 0.02
"""Paths that differ by less are alike, however short they are [m]."""
LEAST_ACCELERATION = 0.1
"""Bases that accelerate by less elsewhere may do so by as much at the seam: a generated animal goes at one speed
[m/s^2]."""
NEAR_FLOOR = 0.005
"""What is this near to the floor stands on it [m]."""
LARGEST_LEAN = 0.03
"""A base that is this far outside its feet can still be held [m]: it is not the centre of mass."""
FRICTION_ACCELERATION = 7.8
"""What feet can give to a body by friction of 0.8 [m/s^2]."""


@dataclass(frozen=True)
class ClipQuality:
    """Metrics of one clip."""

    name: str
    frames: int
    period: float
    """[s]"""
    residual: float
    """Largest distance of a foot from its target [m]."""
    foot_moved: float
    """Largest distance by which a foot was moved for its leg to reach it [m]."""
    penetration: float
    """Deepest that any part of the robot is below the floor [m]."""
    joint_margin: float
    """Least distance of a joint from its limits [rad]; negative where one is broken."""
    speed_share: float
    """Greatest joint speed over what its motor can do."""
    seam_score: float | None
    """How far the source is from repeating itself across the seam, in standard deviations of the motion; none where the
    file ends with the range."""
    seam_jump: float | None
    """Mean way of the feet across the seam, over the mean of all frames; none of a motion played once."""
    seam_step: float | None
    """The same over the mean of the frames next to the seam: 1 for a seam that cannot be seen."""
    speed: float
    """Mean speed of the base in the ground plane [m/s]."""
    path_error: float
    """Length of the base's path against the scaled source's, less 1."""
    slow_down: float
    """By which the motion was slowed to keep within the motors' speeds."""
    start: int
    end: int
    """Range of source frames that was used."""
    fidelity: Fidelity
    """How truly it moves as the animal does."""
    source_remarks: tuple[str, ...] = ()
    """What was repaired in the file."""
    support_faults: tuple[str, ...] = ()
    """Why the first or the last pose of a motion that is played once cannot be held."""


def assess(retargeted: Retargeted, spec: RobotSpec) -> ClipQuality:
    """Return the metrics of a clip."""
    clip = retargeted.clip
    longer = clip.extended(0, 1)
    assert longer.joints is not None
    assert clip.fidelity is not None
    rotation = to_rotation(longer.root_orientation).as_matrix()
    feet = np.einsum("tij,tkj->tki", rotation, foot_positions(spec, longer.joints)) + longer.root_position[:, None]
    steps = np.linalg.norm(np.diff(feet, axis=0), axis=-1).mean(axis=1)
    bottom = clip.foot_position[..., 2] - spec.foot_radius
    body = lowest_body_point(spec, clip.root_position, clip.root_orientation, clip.joint_position)
    path = np.linalg.norm(np.diff(longer.root_position[:, :2], axis=0), axis=1).sum()
    margin = np.minimum(clip.joint_position - spec.joint_lower, np.array(spec.joint_upper) - clip.joint_position)
    return ClipQuality(
        name=clip.name,
        frames=clip.num_frames,
        period=clip.period,
        residual=float(clip.residual.max()),
        foot_moved=retargeted.foot_moved,
        penetration=float(max(-bottom.min(), -body.min(), 0.0)),
        joint_margin=float(margin.min()),
        speed_share=float((np.abs(clip.joint_velocity) / np.array(spec.joint_speed)).max()),
        seam_score=None if np.isnan(retargeted.seam_score) else retargeted.seam_score,
        seam_jump=None if clip.cycle is None else seam_step(steps, steps[:-1].mean()),
        seam_step=None if clip.cycle is None else seam_step(steps, 0.5 * (steps[-2] + steps[0])),
        speed=float(path / clip.period),
        path_error=float(path / retargeted.source_path_length - 1.0) if retargeted.source_path_length > 1e-6 else 0.0,
        slow_down=clip.slow_down,
        start=clip.origin.start,
        end=clip.origin.end,
        fidelity=clip.fidelity,
        source_remarks=retargeted.remarks,
        support_faults=support_faults(clip),
    )


def support_faults(clip: MotionClip) -> tuple[str, ...]:
    """Return why the first or the last pose of a clip that is played once cannot be held, if so."""
    if clip.cycle is not None:
        return ()
    spec, ends = clip.spec, [0, -1]
    body = lowest_body_point(spec, clip.root_position[ends], clip.root_orientation[ends], clip.joint_position[ends])
    faults = []
    for name, frame, height in zip(("first", "last"), ends, body, strict=True):
        feet = clip.foot_position[frame]
        ground = feet[feet[:, 2] - spec.foot_radius < NEAR_FLOOR, :2] - clip.root_position[frame, :2]
        if height < NEAR_FLOOR:
            continue
        lean = distance_to_hull(ground)
        if len(ground) < 3 or lean > LARGEST_LEAN:
            why = (
                f"{len(ground)} feet stand" if len(ground) < 3 else f"the base is {1e3 * lean:.0f} mm outside its feet"
            )
            faults.append(f"the {name} pose cannot be held: {why}; choose a range that begins and ends in a stand")
    return tuple(faults)


def distance_to_hull(points: Array) -> float:
    """Return how far the origin is from the convex hull of points, shape [num_points, 2]; infinite without points."""
    if len(points) == 0:
        # SciPy's nnls corrupts memory where there is nothing to choose from.
        return float("inf")
    # Shares of the points that add up to one, by least squares with a heavy row for their sum.
    weight = 1e3
    rows = np.vstack([points.T, np.full(len(points), weight)])
    shares, _ = nnls(rows, np.array([0.0, 0.0, weight]))
    return float(np.linalg.norm(shares @ points))


def seam_step(steps: Array, normal: float) -> float:
    """Return the last of the steps [m] over a normal one."""
    # Where all feet stand, steps are as small as the solver's tolerance and their ratio means nothing.
    return float((steps[-1] + 1e-3) / (normal + 1e-3))


def clip_remarks(quality: ClipQuality) -> list[str]:
    """Return the faults of a clip, and in what else it is not as its animal."""
    ours, remarks = quality.fidelity, [*clip_faults(quality), *quality.source_remarks]
    if quality.seam_score is not None and quality.seam_score > 1.0:
        remarks.append(f"the source does not repeat itself: seam score {quality.seam_score:.2f}")
    if abs(ours.trunk_pitch) > 2.0:
        remarks.append(f"trunk pitched by {ours.trunk_pitch:+.1f} deg")
    if min(ours.swing_front, ours.swing_hind) < 0.85:
        remarks.append(f"swing height kept: {ours.swing_front:.2f} front, {ours.swing_hind:.2f} hind")
    if abs(ours.duty) > 0.04:
        remarks.append(f"feet stand {100.0 * ours.duty:+.0f} % of the time against the animal's")
    if ours.height_correlation < 0.9:
        remarks.append(f"base height follows the trunk's with r = {ours.height_correlation:.2f}")
    if ours.base_dip > 0.015:
        remarks.append(f"base dips by {1e3 * ours.base_dip:.0f} mm")
    at_seam, usual = ours.seam_acceleration, max(ours.other_acceleration, LEAST_ACCELERATION)
    if at_seam > 1.2 * usual or at_seam > FRICTION_ACCELERATION > ours.animal_acceleration:
        remarks.append(f"{at_seam:.1f} m/s^2 at the seam, {ours.other_acceleration:.1f} elsewhere")
    if quality.slow_down > 1.0:
        remarks.append(f"slowed by {quality.slow_down:.2f} for the motors")
    return remarks


def clip_faults(quality: ClipQuality) -> list[str]:
    """Return which of the metrics that a reference should meet it does not.

    A seam is one to complain of when it is large against the mean step *and* against those beside it: feet in a swing
    move faster than the mean without any seam.
    """
    ours, faults = quality.fidelity, list(quality.support_faults)
    if quality.period < SHORTEST_CYCLE * 0.999:
        faults.append(f"a cycle of {quality.period:.2f} s holds no stride")
    if quality.penetration > 0.002:
        faults.append(f"penetration {1e3 * quality.penetration:.1f} mm")
    if ours.contact_slip > 0.05:
        faults.append(f"slip {ours.contact_slip:.3f} m/s of feet on the floor")
    jump, step = quality.seam_jump, quality.seam_step
    if jump is not None and step is not None and min(jump, step) > LARGEST_JUMP:
        faults.append(f"seam jump {jump:.2f} mean steps, {step:.2f} of those beside it")
    if abs(ours.seam_shift) > 0.1:
        faults.append(f"the legs are {ours.seam_shift:+.2f} strides off across the seam")
    if abs(quality.path_error) > 0.05 and abs(quality.path_error) * quality.speed * quality.period > SHORTEST_WAY:
        faults.append(f"path length off by {100.0 * quality.path_error:.1f} %")
    if quality.joint_margin < 0.0:
        faults.append(f"joint limit broken by {-quality.joint_margin:.3f} rad")
    if quality.speed_share > 1.0 + 1e-9:
        faults.append(f"joint speed {quality.speed_share:.2f} of the motor's")
    if quality.foot_moved > 0.1:
        faults.append(f"a foot of the animal is {1e3 * quality.foot_moved:.0f} mm out of reach")
    if quality.residual > 0.005:
        faults.append(f"a foot is {1e3 * quality.residual:.0f} mm from its target, out of reach")
    return faults
