"""What a benchmarked policy sees: the features of the exports, computed from the states of all worlds."""

import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.errors import PolicyError
from kine2go_warp.exports.features import GOAL, STATE, Feature

Rows = dict[str, NDArray[Any]]

FEATURES: dict[str, Feature] = {feature.name: feature for feature in (*STATE, *GOAL)}
ACTION = "action"
"""Earlier actions of the policy itself, which it sees as ``action-1`` and so on."""
NAME = re.compile(r"([a-z_]+)([+-]\d+)?")
GOALS = frozenset(feature.name for feature in GOAL)


class Observation(Mapping[str, NDArray[np.float32]]):
    """Features of all worlds by name, each of shape [num_worlds, size], computed when they are asked for.

    ``joint_position`` is of the present row and ``joint_position-2`` of two rows before; before the first row there is
    the first row. ``goal_joint_position+10`` is of the reference ten rows later, seen from the robot as it stands now;
    beyond the last row there is the last row. ``action-1`` is the action before.
    """

    def __init__(self, reference: Rows, first_action: NDArray[Any]) -> None:
        """Know the references of all rows in advance.

        Args:
            reference: Arrays of the reference by name, each of shape [num_worlds, num_rows, ...].
            first_action: Action before the first row, shape [num_worlds, 12].
        """
        self._reference, self._first_action = reference, first_action
        self._states: list[Rows] = []
        self._actions: list[NDArray[Any]] = []

    def add_state(self, state: Rows) -> None:
        """Begin the next row with the states of all worlds."""
        self._states.append(state)

    @property
    def state(self) -> Rows:
        """States of all worlds in the present row by the names of the dataset, each of shape [num_worlds, ...]."""
        return self._states[-1]

    def add_action(self, action: NDArray[Any]) -> None:
        """Keep the actions of the present row."""
        self._actions.append(action)

    def __getitem__(self, key: str) -> NDArray[np.float32]:
        name, offset = parsed(key)
        row = len(self._states) - 1
        if name == ACTION:
            past = row + offset
            return np.asarray(self._actions[past] if past >= 0 else self._first_action, np.float32)
        state = self._states[max(row + min(offset, 0), 0)]
        last = next(iter(self._reference.values())).shape[1] - 1
        place = min(max(row + offset, 0), last)
        rows = {**state, **{array: values[:, place] for array, values in self._reference.items()}}
        values = np.asarray(FEATURES[name].compute(rows), np.float32)
        return values.reshape(len(values), -1)

    def __contains__(self, key: object) -> bool:
        try:
            parsed(str(key))
        except PolicyError:
            return False
        return True

    def __iter__(self) -> Iterator[str]:
        yield from (*FEATURES, f"{ACTION}-1")

    def __len__(self) -> int:
        return len(FEATURES) + 1

    def stacked(self, keys: tuple[str, ...]) -> NDArray[np.float32]:
        """Return several features side by side, shape [num_worlds, sum of sizes]."""
        return np.concatenate([self[key] for key in keys], axis=1)


def parsed(key: str) -> tuple[str, int]:
    """Return the feature that a key names, and its row relative to the present one.

    Raises:
        PolicyError: there is no such feature, or it is not known at that time.
    """
    match = NAME.fullmatch(key)
    name, offset = (match[1], int(match[2] or 0)) if match else (key, 0)
    if name not in FEATURES and name != ACTION:
        raise PolicyError(f"there is no feature '{key}'; known are {', '.join((*FEATURES, ACTION))}")
    if (name == ACTION and offset >= 0) or (name not in GOALS and offset > 0):
        raise PolicyError(f"'{key}' is not known to the robot yet; write {name}-1 for the row before")
    return name, offset


def recorded_observations(
    rows: Mapping[str, NDArray[Any]], first_action: NDArray[Any], keys: tuple[str, ...]
) -> NDArray[np.float32]:
    """Return what a policy would have seen in recorded trajectories, to learn from: the same as in the benchmark.

    Args:
        rows: Row arrays of a dataset by name, states, references and ``action``, each of shape
            [num_trajectories, num_rows, ...].
        first_action: Action before the first row, shape [num_trajectories, 12].
        keys: Features, side by side.

    Returns:
        Shape [num_trajectories, num_rows, size].
    """
    reference = {name: values for name, values in rows.items() if name.startswith("reference_")}
    seen, found = Observation(reference, first_action), []
    for row in range(rows[ACTION].shape[1]):
        seen.add_state({name: values[:, row] for name, values in rows.items() if name not in reference})
        found.append(seen.stacked(keys))
        seen.add_action(rows[ACTION][:, row])
    return np.stack(found, axis=1)
