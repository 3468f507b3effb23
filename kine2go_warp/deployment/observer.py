"""The observation from measured states, in NumPy, written from the table in docs/environment.md.

It shares no code with the simulation's kernels, so that the two can be held against each other.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.deployment.metadata import ObservationRow, PolicyMetadata
from kine2go_warp.deployment.reference import Reference
from kine2go_warp.deployment.rotations import about_z, heading, to_matrix
from kine2go_warp.errors import PolicyError

Array = NDArray[np.float64]
Quantities = dict[str, Array]

ROW_NAME = re.compile(r"(\w+)\[t([+-]\d+)?\]")


@dataclass(frozen=True)
class MeasuredState:
    """What a robot, or a simulator in its place, measures at one instant. The world frame has z up."""

    root_position: Array
    """Base link origin, world frame [m], shape [3]."""
    root_orientation: Array
    """Base link (w, x, y, z), shape [4]."""
    root_linear_velocity: Array
    """Velocity of the base link origin, world frame [m/s], shape [3]."""
    root_angular_velocity: Array
    """World frame [rad/s], shape [3]."""
    joint_position: Array
    """[rad], shape [12]."""
    joint_velocity: Array
    """[rad/s], shape [12]."""


class ObservationBuilder:
    """Puts observations together, row by row of the policy's own table."""

    def __init__(self, metadata: PolicyMetadata, reference: Reference) -> None:
        """Read the table.

        Raises:
            PolicyError: it has a row of a name that is not known here.
        """
        self.reference = reference
        self.size = metadata.observation_size
        self.default = np.array(metadata.default_joint_position)
        self._rows = [(slice(row.start, row.stop), *parsed(row)) for row in metadata.observation]
        self._length = 1 - min(offset for *_, offset in self._rows)
        self._ahead = sorted({offset for *_, offset in self._rows if offset > 0})
        self._history: list[Quantities] = []

    def begin(self) -> None:
        """Forget the states of an earlier episode."""
        self._history = []

    def observe(self, state: MeasuredState, last_action: NDArray[Any], step: int) -> NDArray[np.float32]:
        """Return the observation, shape [size]. Call it once in every control step.

        Args:
            state: What is measured now.
            last_action: The network's action of the step before, zero at the beginning.
            step: Control steps since the episode began.
        """
        now = own_state(state, np.asarray(last_action, np.float64), self.default)
        kept = self._history or [now] * self._length
        self._history = [now, *kept][: self._length]
        references = {ahead: self._reference_at(state, step + ahead) for ahead in self._ahead}
        observation = np.empty(self.size, np.float32)
        for place, name, offset in self._rows:
            source = references[offset] if offset > 0 else self._history[-offset]
            observation[place] = source[name]
        return observation

    def _reference_at(self, state: MeasuredState, step: int) -> Quantities:
        """Return the reference at a control step as the robot sees it from where it is now."""
        root = self.reference.root(step)
        to_heading = about_z(-heading(to_matrix(state.root_orientation)))
        axes = to_heading @ root.rotation
        return {
            "reference_position_h": to_heading @ (root.position - state.root_position),
            "reference_forward_h": axes[:, 0],
            "reference_left_h": axes[:, 1],
            "reference_joint_position": self.reference.joint_position(step) - self.default,
        }


def own_state(state: MeasuredState, last_action: Array, default: Array) -> Quantities:
    """Return what the robot knows of itself."""
    to_base = to_matrix(state.root_orientation).T
    return {
        "down_b": -to_base[:, 2],
        "linear_velocity_b": to_base @ state.root_linear_velocity,
        "angular_velocity_b": to_base @ state.root_angular_velocity,
        "joint_position": state.joint_position - default,
        "joint_velocity": state.joint_velocity,
        "last_action": last_action,
    }


KNOWN = {
    "down_b": 3,
    "linear_velocity_b": 3,
    "angular_velocity_b": 3,
    "joint_position": 12,
    "joint_velocity": 12,
    "last_action": 12,
    "reference_position_h": 3,
    "reference_forward_h": 3,
    "reference_left_h": 3,
    "reference_joint_position": 12,
}
"""Quantities that are known here, and their sizes."""

ESTIMATED = ("linear_velocity_b", "reference_position_h")
"""Those that need the position or the velocity of the root, which a legged robot can only estimate."""


def estimated_rows(rows: Iterable[ObservationRow]) -> list[str]:
    """Return the quantities of an observation that need an estimate of the root."""
    names = {parsed(row)[0] for row in rows}
    return [name for name in ESTIMATED if name in names]


def parsed(row: ObservationRow) -> tuple[str, int]:
    """Return the quantity of a row and its time relative to now [control steps].

    Raises:
        PolicyError: this quantity is not known here.
    """
    match = ROW_NAME.fullmatch(row.name)
    name, offset = (match[1], int(match[2] or 0)) if match else (row.name, 0)
    is_reference = name.startswith("reference_")
    if not match or KNOWN.get(name) != row.stop - row.start or is_reference != (offset > 0):
        raise PolicyError(f"the observation has a row '{row.name}' of {row.stop - row.start} values, unknown here")
    return name, offset
