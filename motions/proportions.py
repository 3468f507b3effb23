"""How an animal compares with the Go2, measured on its motion: a first guess for animals that nobody has described."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.motions.floor import fit_floor
from kine2go_warp.motions.keypoints import KeypointMotion
from kine2go_warp.motions.sources.base import Proportions
from kine2go_warp.robots.spec import GO2_THIGH_OFFSET
from kine2go_warp.rotations import turn_planar

Array = NDArray[np.float64]

HIP_HEIGHT = 0.305
"""Height at which the hips of a Go2 are carried while it walks as a dog does [m]."""
GOING = 0.5
"""An animal goes somewhere if its trunk moves by this many of its lengths a second."""
LEAST_SHARE = 0.1
"""Of the frames; where it goes less, as on a treadmill, all of them are measured."""


def measured_proportions(motion: KeypointMotion) -> Proportions:
    """Return how an animal compares with the Go2.

    Its hips are brought to the height at which the Go2 carries its own, the robot's base is parallel to the line from
    its hips to its shoulders and as high, and its feet stand below the robot's thighs.

    Args:
        motion: The whole motion; walking or trotting, the measures are best.
    """
    _, floor = fit_floor(motion, is_level=True)
    motion = going(motion)
    hips, toes = motion.points("hip"), motion.points("toe")
    pelvis, neck = motion.point("pelvis"), motion.point("neck")
    height = float(np.median(hips[..., 2]) - np.mean(floor))
    scale = HIP_HEIGHT / height
    forward = neck - pelvis
    line = hips[:, :2].mean(axis=1) - hips[:, 2:].mean(axis=1)
    slope = line[:, 2] / np.linalg.norm(line[:, :2], axis=1)
    rise = slope * np.linalg.norm(forward[:, :2], axis=1)
    yaw = np.arctan2(forward[:, 1], forward[:, 0])
    outward = turn_planar(toes - hips, -yaw[:, None])[..., 1] * [1.0, -1.0, 1.0, -1.0]
    return Proportions(
        scale=scale,
        root_drop=scale * float(np.median(0.5 * (pelvis + neck)[:, 2]) - np.median(hips[..., 2])),
        forward_lift=scale * float(np.median(rise - forward[:, 2])),
        foot_outward=GO2_THIGH_OFFSET - scale * float(np.median(outward)),
    )


def going(motion: KeypointMotion) -> KeypointMotion:
    """Return the frames in which an animal goes somewhere, so neither stands nor sits nor lies."""
    middle = 0.5 * (motion.point("pelvis") + motion.point("neck"))[:, :2]
    window = max(round(motion.rate), 1)
    last = np.minimum(np.arange(len(middle)) + window, len(middle) - 1)
    first = np.maximum(last - window, 0)
    speed = np.linalg.norm(middle[last] - middle[first], axis=1) / np.maximum(last - first, 1) * motion.rate
    goes = speed > GOING * motion.trunk_length
    if goes.mean() < LEAST_SHARE:
        return motion
    return replace(motion, time=motion.time[goes], position=motion.position[goes])
