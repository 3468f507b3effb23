"""How good a reference clip is, in figures that a robot cares about."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.motions.body import lowest_body_point
from kine2go_warp.motions.cycle import extend_cyclically
from kine2go_warp.motions.retarget import Retargeted
from kine2go_warp.robots import RobotSpec
from kine2go_warp.robots.kinematics import foot_positions
from kine2go_warp.rotations import to_rotation

Array = NDArray[np.float64]


LARGEST_JUMP = 1.5
"""A seam may be this many normal steps wide."""


@dataclass(frozen=True)
class ClipQuality:
    """Figures of one clip."""

    name: str
    frames: int
    period: float
    """[s]"""
    residual: float
    """Largest distance of a foot from its target [m]."""
    penetration: float
    """Deepest that any part of the robot is below the floor [m]."""
    stance_slip: float
    """Mean speed of standing feet [m/s]."""
    swing_clearance: float
    """Median over swings of the greatest height of the foot [m]."""
    joint_margin: float
    """Least distance of a joint from its limits [rad]; negative where one is broken."""
    speed_share: float
    """Greatest joint speed over what its motor can do."""
    seam_score: float | None
    """How far the source is from repeating itself across the seam, in standard deviations of the motion; none where the
    file ends with the range."""
    seam_jump: float
    """Mean way of the feet across the seam, over the mean of all frames."""
    seam_step: float
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
    source_remarks: tuple[str, ...] = ()
    """What was repaired in the file."""


def assess(retargeted: Retargeted, spec: RobotSpec) -> ClipQuality:
    """Return the figures of a clip."""
    clip = retargeted.clip
    longer = extend_cyclically(clip.root_position, clip.root_orientation, clip.joint_position, clip.cycle, 0, 1)
    rotation = to_rotation(longer.root_orientation).as_matrix()
    feet = np.einsum("tij,tkj->tki", rotation, foot_positions(spec, longer.channels)) + longer.root_position[:, None]
    steps = np.linalg.norm(np.diff(feet, axis=0), axis=-1)
    planar = np.linalg.norm(np.diff(feet[..., :2], axis=0), axis=-1) / clip.frame_duration
    stance = clip.stance > 0.5
    standing = stance & np.roll(stance, -1, axis=0)
    bottom = clip.foot_position[..., 2] - spec.foot_radius
    body = lowest_body_point(spec, clip.root_position, clip.root_orientation, clip.joint_position)
    path = np.linalg.norm(np.diff(longer.root_position[:, :2], axis=0), axis=1).sum()
    margin = np.minimum(clip.joint_position - spec.joint_lower, np.array(spec.joint_upper) - clip.joint_position)
    mean_step = steps[:-1].mean()
    return ClipQuality(
        name=clip.name,
        frames=clip.num_frames,
        period=clip.period,
        residual=float(clip.residual.max()),
        penetration=float(max(-bottom.min(), -body.min(), 0.0)),
        stance_slip=float(planar[standing].mean()) if standing.any() else 0.0,
        swing_clearance=swing_clearance(bottom, stance),
        joint_margin=float(margin.min()),
        speed_share=float((np.abs(clip.joint_velocity) / np.array(spec.joint_speed)).max()),
        seam_score=None if np.isnan(retargeted.seam_score) else retargeted.seam_score,
        seam_jump=float(steps[-1].mean() / mean_step) if mean_step > 1e-6 else 0.0,
        seam_step=seam_step(steps.mean(axis=1)),
        speed=float(path / clip.period),
        path_error=float(path / retargeted.source_path_length - 1.0) if retargeted.source_path_length > 1e-6 else 0.0,
        slow_down=clip.slow_down,
        start=clip.origin.start,
        end=clip.origin.end,
        source_remarks=retargeted.remarks,
    )


def seam_step(steps: Array) -> float:
    """Return the last of the steps [m] over the mean of its two neighbours in the cycle."""
    beside = 0.5 * (steps[-2] + steps[0])
    # Where all feet stand, steps are as small as the solver's tolerance and their ratio means nothing.
    return float((steps[-1] + 1e-3) / (beside + 1e-3))


def swing_clearance(bottom: Array, stance: NDArray[np.bool_]) -> float:
    """Return the median over all swings of the greatest height of the foot [m]."""
    heights = []
    for foot in range(stance.shape[1]):
        edges = np.flatnonzero(np.diff(np.concatenate([[True], stance[:, foot], [True]]).astype(int)))
        heights += [float(bottom[first:end, foot].max()) for first, end in edges.reshape(-1, 2)]
    return float(np.median(heights)) if heights else 0.0


def clip_remarks(quality: ClipQuality) -> list[str]:
    """Return the faults of a clip, and what else its figures need explained."""
    remarks = [*clip_faults(quality), *quality.source_remarks]
    if quality.seam_jump > LARGEST_JUMP >= quality.seam_step:
        remarks.append(f"seam {quality.seam_jump:.2f} mean steps, for it lies in a swing")
    if quality.slow_down > 1.0:
        remarks.append(f"slowed by {quality.slow_down:.2f} for the motors")
    return remarks


def clip_faults(quality: ClipQuality) -> list[str]:
    """Return which of the figures that a reference should meet it does not.

    A seam is one to complain of when it is large against the mean step *and* against those beside it: feet in a swing
    move faster than the mean without any seam.
    """
    faults = []
    if quality.penetration > 0.002:
        faults.append(f"penetration {1e3 * quality.penetration:.1f} mm")
    if quality.stance_slip > 0.05:
        faults.append(f"stance slip {quality.stance_slip:.3f} m/s")
    if min(quality.seam_jump, quality.seam_step) > LARGEST_JUMP:
        faults.append(f"seam jump {quality.seam_jump:.2f} mean steps, {quality.seam_step:.2f} of those beside it")
    if abs(quality.path_error) > 0.05:
        faults.append(f"path length off by {100.0 * quality.path_error:.1f} %")
    if quality.joint_margin < 0.0:
        faults.append(f"joint limit broken by {-quality.joint_margin:.3f} rad")
    if quality.speed_share > 1.0 + 1e-9:
        faults.append(f"joint speed {quality.speed_share:.2f} of the motor's")
    if quality.residual > 0.005:
        faults.append(f"a foot is {1e3 * quality.residual:.0f} mm from its target, out of reach")
    return faults
