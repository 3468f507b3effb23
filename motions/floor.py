"""The floor below an animal, from its standing feet."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from kine2go_warp.motions.keypoints import KeypointMotion
from kine2go_warp.motions.stance import median

Array = NDArray[np.float64]

SLOW_SHARE = 0.15
"""A toe slower than this share of its fast moments may stand."""
UPRIGHT_SHARE = 0.8
"""A leg bears the animal while its hip is this share of its usual height above the toe: not in sitting and lying."""
PASSES = 15
"""Passes in which toes above the floor lose their weight."""
LEVEL_ENOUGH = np.radians(0.25)
"""A floor is taken for level up to this slope [rad], or up to ``LEVEL_RISE``."""
LEVEL_RISE = 0.05
"""Rise over the whole way that is taken for level, as a share of the trunk's length."""
STEEPEST = np.radians(15.0)
"""A slope beyond this is no floor [rad]."""


def fit_floor(motion: KeypointMotion, is_level: bool = False) -> tuple[Array, Array]:
    """Return the floor's slope, dz/dx and dz/dy, and the height of each toe that stands in the middle of the way [m].

    A plane with a height of its own for each toe is fitted to slow toes. Toes that are slow in the air, as of an animal
    that sits or lies, lie above it and lose their weight from pass to pass; a way too short to tell a slope keeps 0.

    Args:
        motion: The animal's motion.
        is_level: Whether the floor is known to be level.
    """
    toes = motion.points("toe")
    size = motion.trunk_length
    speed = np.linalg.norm(np.gradient(toes, 1.0 / motion.rate, axis=0), axis=-1)
    slow = speed <= SLOW_SHARE * np.quantile(speed, 0.95, axis=0) + 0.05 * size
    leg_height = motion.points("hip")[..., 2] - toes[..., 2]
    slow &= leg_height > UPRIGHT_SHARE * np.quantile(leg_height, 0.9, axis=0)
    slow[:, ~slow.any(axis=0)] = True
    leg, frame = np.nonzero(slow.T)
    samples = np.ascontiguousarray(toes[frame, leg].T)
    samples[:2] -= np.median(samples[:2], axis=1, keepdims=True)
    of_leg = (np.arange(4) == leg[:, None]).astype(float)
    slope, low, spread = np.zeros(2), np.zeros(4), 0.5 * size
    # Half a trunk of way with as many samples as there are: a slope needs more way than that to be believed.
    ridge = len(leg) * (0.5 * size) ** 2 * 0.05 * np.eye(2)
    weight = np.ones(len(leg))
    for _ in range(PASSES):
        centres = (weight * samples) @ of_leg / np.maximum(weight @ of_leg, 1e-9)
        apart = samples - np.take(centres, leg, axis=1)
        if not is_level:
            weighted = weight * apart[:2]
            slope = np.linalg.solve(weighted @ apart[:2].T + ridge, weighted @ apart[2])
        low = centres[2] - slope @ centres[:2]
        above = apart[2] - slope @ apart[:2]
        kept = weight > 0.0
        typical = 1.5 * float(median(np.abs(above[kept]))) if kept.any() else spread
        spread = max(typical, 0.6 * spread, 0.005 * size)
        share = above / np.where(above > 0.0, 1.5 * spread, 4.0 * spread)
        weight = np.maximum(1.0 - share * share, 0.0) ** 2
    return slope, np.asarray(low, dtype=np.float64)


def levelled(motion: KeypointMotion) -> KeypointMotion:
    """Return a motion whose floor is level, with a remark if it was not."""
    slope, _ = fit_floor(motion)
    tilt = float(np.arctan(np.linalg.norm(slope)))
    way = motion.points("toe")[..., :2].reshape(-1, 2) @ (slope / max(np.linalg.norm(slope), 1e-12))
    rise = float(np.ptp(way) * np.linalg.norm(slope))
    size = motion.trunk_length
    if tilt <= LEVEL_ENOUGH or rise <= LEVEL_RISE * size or tilt > STEEPEST:
        return motion
    turn = Rotation.from_rotvec(tilt * np.array([-slope[1], slope[0], 0.0]) / np.linalg.norm(slope))
    position = turn.apply(motion.position.reshape(-1, 3)).reshape(motion.position.shape)
    remark = f"the floor rose by {np.degrees(tilt):.1f} degrees, {100.0 * rise:.0f} cm over the way; levelled"
    return replace(motion, position=position, remarks=(*motion.remarks, remark))
