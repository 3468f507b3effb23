"""How well rollouts track their reference, from the rows alone."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Rows = Mapping[str, NDArray]


def tracking_quality(rows: Rows) -> dict[str, NDArray]:
    """Return the arrays of ``QUALITY_ARRAYS``, each of shape [num_trajectories]. Padding (NaN) does not count."""
    joint = (rows["joint_position"] - rows["reference_joint_position"]).astype(np.float64)
    root = np.linalg.norm(rows["root_position"] - rows["reference_root_position"], axis=-1)
    feet = rows["link_position"][..., -4:, :] - rows["reference_foot_position"]
    return {
        "joint_rmse": np.sqrt(np.nanmean(joint**2, axis=(1, 2))),
        "root_error": np.nanmean(root, axis=1),
        "root_angle": np.nanmean(rotation_angle(rows["root_orientation"], rows["reference_root_orientation"]), axis=1),
        "foot_error": np.nanmean(np.linalg.norm(feet, axis=-1), axis=(1, 2)),
    }


def rotation_angle(a: NDArray, b: NDArray) -> NDArray:
    """Return the angle between unit quaternions [rad], shape [...], from shape [..., 4]."""
    # |a - b| and |a + b| of the closer sign: exact for small angles, where the arc cosine of a product is not.
    apart = np.linalg.norm(np.asarray(a, np.float64) - b, axis=-1)
    together = np.linalg.norm(np.asarray(a, np.float64) + b, axis=-1)
    return 4.0 * np.arctan2(np.minimum(apart, together), np.maximum(apart, together))
