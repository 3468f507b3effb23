"""A few pictures of a motion's best, median and worst trajectory."""

import base64
import io
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.motion import Motion
from kine2go_warp.renders.process import RenderProcess
from kine2go_warp.renders.video import read_trajectories
from kine2go_warp.reports.film import Film, film

WIDTH, HEIGHT = 320, 240
"""Of a picture [pixels]."""
SHARES = (0.25, 0.5, 0.75)
"""How far into a trajectory its pictures are taken."""
QUALITY = 78
"""Of JPEG, out of 100."""


@dataclass(frozen=True)
class Shot:
    """One picture."""

    address: str
    """The picture itself, as a data URI."""
    row: int
    time: float
    """From the first row [s]."""


@dataclass(frozen=True)
class Strip:
    """Pictures of one trajectory."""

    rank: str
    """``best``, ``median`` or ``worst``."""
    index: int
    """Its place in the motion."""
    value: float
    """Its joint RMSE [rad]."""
    shots: tuple[Shot, ...]
    film: Film


def ranked_trajectories(values: NDArray[Any]) -> dict[str, int]:
    """Return the trajectories with the least, the middle and the largest value; each one only once."""
    order = [int(index) for index in np.argsort(values, kind="stable") if not np.isnan(values[index])]
    if not order:
        return {}
    chosen = {"best": order[0], "median": order[(len(order) - 1) // 2], "worst": order[-1]}
    once: dict[str, int] = {}
    for rank, index in chosen.items():
        if index not in once.values():
            once[rank] = index
    return once


def strips(
    renderer: RenderProcess, motion: Motion, joint_rmse: NDArray[Any], indices: NDArray[Any]
) -> tuple[Strip, ...]:
    """Draw the best, the median and the worst trajectory of a motion.

    Args:
        renderer: Draws pictures of ``WIDTH`` x ``HEIGHT``.
        motion: The motion.
        joint_rmse: By which they are ranked [rad], shape [num_trajectories].
        indices: Index of each of these trajectories in the store, same shape.

    Raises:
        RenderError: poses are not finite.
        DatasetError: the motion cannot be read.
    """
    chosen = ranked_trajectories(joint_rmse)
    trajectories = read_trajectories(motion, [int(indices[place]) for place in chosen.values()])
    result = []
    for (rank, place), trajectory in zip(chosen.items(), trajectories, strict=True):
        rows = [round(share * (len(trajectory.time) - 1)) for share in SHARES]
        shots = tuple(
            Shot(jpeg_address(renderer.draw(trajectory.request(row))), row, float(trajectory.time[row])) for row in rows
        )
        result.append(Strip(rank, trajectory.index, float(joint_rmse[place]), shots, film(trajectory, motion.robot)))
    return tuple(result)


def jpeg_address(picture: NDArray[np.uint8]) -> str:
    """Return a picture as a data URI."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, "JPEG", quality=QUALITY, optimize=True)
    return "data:image/jpeg;base64," + base64.b64encode(buffer.getvalue()).decode()
