"""Sitting, lying, stretching: when parts other than the feet rest on the floor, and where the base is then.

An animal sits on its rump and hocks and lies on elbows and belly. The robot's parts in their places are the knees, at
which its thighs end, and the trunk. Folded legs are longer than an animal's, so the robot is as low as they allow.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded
from scipy.spatial.transform import Rotation

from kine2go_warp.motions.body import hip_joints, joints_for, leg_length_limits, part_heights
from kine2go_warp.motions.keypoints import KeypointMotion
from kine2go_warp.motions.poses import Poses
from kine2go_warp.motions.stance import intervals
from kine2go_warp.robots import RobotSpec
from kine2go_warp.rotations import continuous, from_rotation, heading, to_rotation, turn_planar

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LOW_SHARE, LOW_RISE = 0.4, 0.5
"""Hips lower than the first share of the trunk's length come to rest; they rest until they are above the second."""
LOW_SPEED = 0.3
"""They move by less than this share of the trunk's length in a second when they come to rest and when they rise."""
SHORTEST_REST = 0.1
"""An end that rests for less does not rest [s]."""
SHIFT_COST = np.array([0.3, 1.0, 1.0, 0.2, 0.2])
"""What shifts of the base forward, to the left and up cost [1], and roll and pitch [m/rad]."""
ACCELERATION_COST = 0.02
"""What accelerations of these shifts cost in proportion to the shifts [s^2]."""
BREACH_COSTS = (3.0, 10.0, 30.0, 100.0)
"""What breaches of the legs' and the joints' limits and depths in the floor cost, in rounds one after the other [1]."""
TRUNK_SHARE = 0.6
"""A gap below the trunk counts as this share of one below a knee: it closes where the legs are spread enough."""
GAP_COST = 5.0
"""What gaps between the floor and what rests on it cost at most [1]."""
STEPS, RETRIES = 6, 8
"""Steps of a round, and how often a step that does not help is made shorter."""
PROBE = 1e-5
"""Step of finite differences [m, rad]."""
JOINT_LEVER = 0.2
"""A joint beyond its limit by 1 rad counts as this far [m]."""


def resting_ends(motion: KeypointMotion, floor: float) -> Mask:
    """Return whether the front and the rear of an animal rest on the floor, shape [num_frames, 2].

    Elbows and belly do while the shoulders are near the floor and hardly move, rump and hocks while the hips do.

    Args:
        motion: The animal's motion.
        floor: Height of its floor [m].
    """
    hips = motion.points("hip").reshape(-1, 2, 2, 3).mean(axis=2)
    height, size = hips[..., 2] - floor, motion.trunk_length
    speed = np.linalg.norm(np.gradient(hips, 1.0 / motion.rate, axis=0), axis=-1)
    still = (height < LOW_SHARE * size) & (speed < LOW_SPEED * size)
    found = np.zeros_like(still)
    for end in range(2):
        for run in intervals(height[:, end] < LOW_RISE * size):
            rests = np.flatnonzero(still[run.frames, end])
            if len(rests) >= SHORTEST_REST * motion.rate:
                found[run.first + rests[0] : run.first + rests[-1] + 1, end] = True
    return found


def side_by_side(poses: Poses, stance: Mask, rests: Mask) -> Poses:
    """Return poses whose feet stand side by side at an end that rests, so that both knees can lie on the floor.

    Both feet are moved along the heading, by the same way all through their stance, to where their mean was.

    Args:
        poses: With feet.
        stance: Whether each foot stands, shape [num_frames, 4].
        rests: Whether front and rear rest, shape [num_frames, 2].
    """
    assert poses.feet is not None
    feet, yaw = poses.feet.copy(), heading(poses.root_orientation)
    ahead = turn_planar(feet - poses.root_position[:, None], -yaw[:, None])[..., 0]
    for end in range(2):
        for rest in intervals(rests[:, end]):
            place = np.median(ahead[rest.frames, 2 * end : 2 * end + 2], axis=0)
            way = turn_planar(np.array([1.0, 0.0, 0.0]), float(np.median(yaw[rest.frames])))
            for foot, apart in zip((2 * end, 2 * end + 1), place.mean() - place, strict=True):
                for run in intervals(stance[:, foot]):
                    if run.last >= rest.first and run.first <= rest.last:
                        feet[run.frames, foot] += apart * way
    return replace(poses, feet=feet)


def settle(poses: Poses, rests: Mask, spec: RobotSpec, frame_duration: float, margin: float) -> Poses:
    """Return poses whose base is where legs reach the feet, nothing is in the floor, and what rests lies on it.

    The base is shifted and tilted as little as that needs, and smoothly: least squares over all frames at once, by the
    method of Levenberg and Marquardt. Costs of breaches grow from round to round, so that the way there is smooth.

    Args:
        poses: With feet, which stay.
        rests: Whether front and rear rest, shape [num_frames, 2].
        spec: The robot.
        frame_duration: [s]
        margin: How far joints keep off their limits [rad].
    """
    problem = _Settling(poses, rests, spec, frame_duration, margin)
    shift = np.zeros((len(poses), len(SHIFT_COST)))
    for cost in BREACH_COSTS:
        shift = problem.improved(shift, cost)
    return shifted(poses, shift)


def shifted(poses: Poses, shift: Array) -> Poses:
    """Return poses with the base moved and turned, as seen in its heading frame; the feet stay.

    Args:
        poses: Poses.
        shift: Forward, left and up [m], roll to the right and nose down [rad], shape [num_frames, 5].
    """
    yaw = heading(poses.root_orientation)
    turn = np.concatenate([shift[:, 3:], np.zeros((len(shift), 1))], axis=1)
    turned = Rotation.from_rotvec(turn_planar(turn, yaw)) * to_rotation(poses.root_orientation)
    position = poses.root_position + turn_planar(shift[:, :3], yaw)
    return replace(poses, root_position=position, root_orientation=continuous(from_rotation(turned)))


@dataclass(frozen=True)
class _Settling:
    """The least squares of ``settle``, whose arguments these are."""

    poses: Poses
    rests: Mask
    spec: RobotSpec
    frame_duration: float
    margin: float

    def residuals(self, shift: Array, cost: float) -> Array:
        """Return what a shift leaves amiss in each frame [m], times its cost, shape [num_frames, 31]."""
        breaches, gaps = limit_breaches(shifted(self.poses, shift), self.rests, self.spec, self.margin)
        return np.concatenate([cost * breaches, min(cost, GAP_COST) * gaps], axis=1)

    def improved(self, shift: Array, cost: float) -> Array:
        """Return a better shift, after some steps at one cost of breaches."""
        weight = SHIFT_COST**2
        stiffness = weight * (ACCELERATION_COST / self.frame_duration**2) ** 2

        def total(shift: Array, left: Array) -> float:
            bends = (np.diff(shift, 2, axis=0) ** 2).sum(axis=0)
            return float((left**2).sum() + weight @ (shift**2).sum(axis=0) + stiffness @ bends)

        axes, damping, left = np.eye(len(weight)), 1.0, self.residuals(shift, cost)
        for _ in range(STEPS):
            slopes = np.stack([(self.residuals(shift + PROBE * one, cost) - left) / PROBE for one in axes], axis=-1)
            normal = np.einsum("tka,tkb->tab", slopes, slopes) + np.diag(weight)
            pull = np.einsum("tka,tk->ta", slopes, left) + weight * shift
            for _ in range(RETRIES):
                tried = shift - smooth_step(normal + damping * axes, pull, shift, stiffness)
                then = self.residuals(tried, cost)
                if total(tried, then) < total(shift, left):
                    shift, left, damping = tried, then, 0.2 * damping
                    break
                damping *= 5.0
            else:
                break
        return shift


def limit_breaches(poses: Poses, rests: Mask, spec: RobotSpec, margin: float) -> tuple[Array, Array]:
    """Return what is beyond a limit, and gaps below what rests [m]; all are 0 where nothing is amiss.

    Arguments as in ``settle``.

    Returns:
        Legs too long or too short for their feet, hip and thigh joints beyond their limits, parts in the floor, shape
        [num_frames, 25]; heights of the knees and of the trunk's lower edge at ends that rest, shape [num_frames, 6].
    """
    assert poses.feet is not None
    shortest, longest = leg_length_limits(spec, margin)
    apart = np.linalg.norm(hip_joints(spec, poses.root_position, poses.root_orientation) - poses.feet, axis=-1)
    length = np.sqrt(np.maximum(apart**2 - spec.legs[0].thigh_offset[1] ** 2, 0.0))
    joints = joints_for(spec, poses)
    # Knees are kept off their limits by the lengths of the legs.
    over = joints - np.clip(joints, np.array(spec.joint_lower) + margin, np.array(spec.joint_upper) - margin)
    over = over.reshape(-1, 4, 3)[..., :2].reshape(-1, 8)
    parts = part_heights(spec, poses.root_position, poses.root_orientation, joints)
    depths = [np.minimum(part, 0.0) for part in parts]
    breaches = [np.maximum(length - longest, 0.0), np.minimum(length - shortest, 0.0), JOINT_LEVER * over, *depths]
    lowest = [np.column_stack([part[:, :2], TRUNK_SHARE * part[:, 2:4].min(axis=1)]) for part in parts]
    gaps = [np.where(rests[:, [end]], np.maximum(lowest[end], 0.0), 0.0) for end in range(2)]
    return np.concatenate(breaches, axis=1), np.concatenate(gaps, axis=1)


def smooth_step(normal: Array, pull: Array, shift: Array, stiffness: Array) -> Array:
    """Return the step that solves the normal equations of all frames, with costs on second differences of what results.

    Args:
        normal: Normal matrices of the frames, shape [num_frames, size, size].
        pull: Their right-hand sides, shape [num_frames, size].
        shift: What the step is subtracted from, shape [num_frames, size].
        stiffness: Weights of the squared second differences, shape [size].
    """
    count, size = shift.shape
    # The upper bands of the matrix, as SciPy wants them: row ``2 size - d`` holds what lies d right of the diagonal.
    bands = np.zeros((2 * size + 1, size * count))
    for row in range(size):
        for column in range(row, size):
            bands[2 * size - (column - row), column::size] = normal[:, row, column]
    bends, bent = np.zeros((3, count)), np.zeros_like(shift)
    second = np.diff(shift, 2, axis=0)
    for place, factor in enumerate((1.0, -2.0, 1.0)):
        inside = slice(place, count - 2 + place)
        bent[inside] += factor * second
        bends[0, inside] += factor**2
    bends[1, 1:-1] -= 2.0
    bends[1, 2:] -= 2.0
    bends[2, 2:] += 1.0
    for off in range(3):
        for axis in range(size):
            bands[(2 - off) * size, axis::size] += stiffness[axis] * bends[off]
    return solveh_banded(bands, (pull + stiffness * bent).ravel()).reshape(count, size)
