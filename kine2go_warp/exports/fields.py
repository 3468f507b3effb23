"""What an exported field is: which arrays of the dataset it holds, column by column."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.motion import Motion


@dataclass(frozen=True)
class Field:
    """One field of an export: one row array of the dataset, or several side by side."""

    name: str
    """Its name in the export."""
    arrays: tuple[str, ...]
    """Row arrays of the dataset that it holds."""
    columns: tuple[str, ...]
    """Name of each of its numbers in a row."""

    def values(self, arrays: Mapping[str, NDArray[Any]]) -> NDArray[np.float32]:
        """Return the field of some rows, shape [num_rows, num_columns].

        Args:
            arrays: Row arrays of one trajectory, each of shape [num_rows, ...].
        """
        parts = [np.asarray(arrays[name], np.float32).reshape(len(arrays[name]), -1) for name in self.arrays]
        return np.ascontiguousarray(np.concatenate(parts, axis=1))


def array_field(motion: Motion, array: str, name: str | None = None) -> Field:
    """Return the field that holds one row array.

    Args:
        motion: Any motion of the dataset.
        array: Name of the array.
        name: Name of the field; by default that of the array.
    """
    return Field(name or array, (array,), motion.column_names(array))


def joined_field(motion: Motion, arrays: tuple[str, ...], name: str) -> Field:
    """Return the field that holds several row arrays side by side, with columns such as ``action.FL_hip_joint``."""
    columns = tuple(f"{array}.{column}" for array in arrays for column in motion.column_names(array))
    return Field(name, arrays, columns)
