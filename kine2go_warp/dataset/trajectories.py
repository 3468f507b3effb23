"""Rollouts of one motion on their way from the simulation to the store."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Groups = dict[str, dict[str, NDArray[Any]]]
"""Arrays of the sub-groups (``SUB_GROUPS``), the first axis of each being the trajectory."""


class Rollouts(Protocol):
    """Equally long rollouts of one motion, whose rows are read a few rollouts at a time."""

    @property
    def num_trajectories(self) -> int:
        """Number of rollouts."""
        ...

    @property
    def num_rows(self) -> int:
        """Rows of the longest possible trajectory."""
        ...

    @property
    def draws(self) -> Mapping[str, NDArray[Any]]:
        """Arrays by their names in ``TRAJECTORY_ARRAYS``, each of shape [num_trajectories]."""
        ...

    @property
    def groups(self) -> Groups:
        """Arrays of the sub-groups."""
        ...

    @property
    def names(self) -> Collection[str]:
        """Names of the row arrays."""
        ...

    def read_rows(self, name: str, first: int, last: int) -> NDArray[Any]:
        """Return the rows of some rollouts, shape [last - first, num_rows, ...]."""
        ...


@dataclass(frozen=True)
class Trajectories:
    """Rollouts in memory."""

    rows: dict[str, NDArray[Any]]
    """Arrays by their names in ``ROW_ARRAYS``, each of shape [num_trajectories, num_rows, ...]."""
    draws: dict[str, NDArray[Any]]
    """Arrays by their names in ``TRAJECTORY_ARRAYS``, each of shape [num_trajectories]."""
    groups: Groups = field(default_factory=dict)

    @property
    def num_trajectories(self) -> int:
        """Number of rollouts."""
        return len(self.draws["length"])

    @property
    def num_rows(self) -> int:
        """Rows of the longest possible trajectory."""
        return self.rows["root_position"].shape[1]

    @property
    def names(self) -> Collection[str]:
        """Names of the row arrays."""
        return self.rows

    def read_rows(self, name: str, first: int, last: int) -> NDArray[Any]:
        """Return the rows of some rollouts, shape [last - first, num_rows, ...]."""
        return self.rows[name][first:last]

    def selected(self, chosen: NDArray[Any]) -> "Trajectories":
        """Return some of the rollouts, by index or mask."""
        return Trajectories(
            {name: values[chosen] for name, values in self.rows.items()},
            {name: values[chosen] for name, values in self.draws.items()},
            {group: {name: values[chosen] for name, values in arrays.items()} for group, arrays in self.groups.items()},
        )

    def padded(self) -> "Trajectories":
        """Return the rollouts with NaN in the rows beyond each one's length."""
        rows = {name: padded(values, self.draws["length"]) for name, values in self.rows.items()}
        return replace(self, rows=rows)


def padded(values: NDArray[Any], lengths: NDArray[Any]) -> NDArray[np.float32]:
    """Return a copy of rows with NaN beyond each trajectory's length, shape [num_trajectories, num_rows, ...]."""
    values = values.astype(np.float32)
    values[np.arange(values.shape[1]) >= np.asarray(lengths)[:, None]] = np.nan
    return values
