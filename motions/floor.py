"""The floor below an animal, from its standing feet."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from kine2go_warp.motions.keypoints import KeypointMotion

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
    leg = np.nonzero(slow)[1]
    centre = np.median(toes[slow], axis=0)
    place, height = toes[slow][:, :2] - centre[:2], toes[slow][:, 2]
    slope = np.zeros(2)
    low = np.array([np.quantile(height[leg == one], 0.1) for one in range(4)])
    spread = 0.5 * size
    # Half a trunk of way with as many samples as there are: a slope needs more way than that to be believed.
    ridge = len(height) * (0.5 * size) ** 2 * 0.05 * np.eye(2)
    for turn in range(PASSES):
        above = height - place @ slope - low[leg]
        weight = (
            np.ones(len(height))
            if turn == 0
            else np.clip(1.0 - (above / np.where(above > 0.0, 1.5, 4.0) / spread) ** 2, 0.0, None) ** 2
        )
        total = np.array([max(weight[leg == one].sum(), 1e-9) for one in range(4)])
        means = np.array(
            [(weight[leg == one, None] * np.c_[place, height][leg == one]).sum(axis=0) for one in range(4)]
        )
        means /= total[:, None]
        x, z = place - means[leg, :2], height - means[leg, 2]
        slope = (
            np.zeros(2)
            if is_level
            else np.linalg.solve((weight[:, None] * x).T @ x + ridge, (weight[:, None] * x).T @ z)
        )
        low = means[:, 2] - means[:, :2] @ slope
        residual = height - place @ slope - low[leg]
        kept = weight > 0.0
        typical = 1.5 * float(np.median(np.abs(residual[kept]))) if kept.any() else spread
        spread = max(typical, 0.6 * spread, 0.005 * size)
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
