"""Rollouts of one motion in memory, on their way from the simulation to the store."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Trajectories:
    """Equally long rollouts of one motion."""

    rows: dict[str, NDArray]
    """Arrays by their names in ``ROW_ARRAYS``, each of shape [num_trajectories, num_rows, ...]."""
    draws: dict[str, NDArray]
    """Arrays by their names in ``TRAJECTORY_ARRAYS``, each of shape [num_trajectories]."""

    @property
    def num_trajectories(self) -> int:
        """Number of rollouts."""
        return len(self.draws["length"])

    @property
    def num_rows(self) -> int:
        """Rows of the longest possible trajectory."""
        return self.rows["root_position"].shape[1]

    def selected(self, chosen: NDArray[np.bool_]) -> "Trajectories":
        """Return some of the rollouts."""
        return Trajectories(
            {name: values[chosen] for name, values in self.rows.items()},
            {name: values[chosen] for name, values in self.draws.items()},
        )

    def padded(self) -> "Trajectories":
        """Return the rollouts with NaN in the rows beyond each one's length."""
        beyond = np.arange(self.num_rows) >= self.draws["length"][:, None]
        rows = {}
        for name, values in self.rows.items():
            rows[name] = values.astype(np.float32)
            rows[name][beyond] = np.nan
        return Trajectories(rows, self.draws)


def continuous_quaternions(wxyz: NDArray) -> NDArray:
    """Flip signs so that neighbours in time never point in opposite directions, shape [num_trajectories, num_rows, 4].

    The first quaternion of each trajectory gets a non-negative real part.
    """
    signs = np.where(np.sum(wxyz[:, 1:] * wxyz[:, :-1], axis=-1) < 0.0, -1.0, 1.0)
    first = np.where(wxyz[:, :1, 0] < 0.0, -1.0, 1.0)
    return wxyz * np.cumprod(np.concatenate([first, signs], axis=1), axis=1)[..., None].astype(wxyz.dtype)
