"""What describes a format of export, and what its writer is given."""

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from kine2go_warp.dataset.access import Dataset
from kine2go_warp.dataset.motion import Motion, Trajectory
from kine2go_warp.dataset.selection import by_motion
from kine2go_warp.errors import ExportError
from kine2go_warp.exports.features import GOAL, STATE, Field, joined, stored


@dataclass(frozen=True)
class Output:
    """What is exported into one folder: trajectories of one licence."""

    dataset: Dataset
    folder: Path
    fields: tuple[Field, ...]
    """What the format holds of a row."""

    @cached_property
    def motions(self) -> tuple[str, ...]:
        """Names of the motions, in their order."""
        return tuple(by_motion(self.dataset.references))

    @property
    def arrays(self) -> tuple[str, ...] | None:
        """Row arrays that are read; none stands for all, which must then be there."""
        wanted = dict.fromkeys(name for field in self.fields for name in field.arrays)
        return None if set(wanted) >= set(self.dataset.motion(self.motions[0]).row_arrays) else tuple(wanted)

    def before(self, motion: str) -> tuple[int, int]:
        """Return how many trajectories and rows the motions before one have."""
        count = self.motions.index(motion)
        earlier = [one for one in self.dataset.references if self.motions.index(one.motion) < count]
        return len(earlier), sum(one.length for one in earlier)


@dataclass(frozen=True)
class Target:
    """A format of export. Motions are written one after the other; what one writes is kept after an interruption."""

    title: str
    write: Callable[[Output, str, Iterator[Trajectory]], None]
    """Writes one motion's trajectories to files of their own."""
    loading: str
    """Python lines that load an export, with ``{motion}``, ``{folder}``, ``{rate}`` in them."""
    fields: Callable[[Motion], list[Field]]
    """What it holds of a row, from any motion of a dataset."""
    finish: Callable[[Output], None] | None = None
    """Writes what stands for all motions together."""
    time_rule: str = "A row is a control step."
    about: str = ""
    """Where it has what is stored once a trajectory; empty if it leaves that out."""
    about_prefix: str = ""
    """What stands before the names of that."""
    check: Callable[[Dataset], None] | None = None
    """Raises an ``ExportError`` if the format cannot hold a dataset."""
    tags: tuple[str, ...] = ()
    """What the Hugging Face Hub lists it under, besides the common ones."""
    data_files: str = ""
    """The files that the Hub shows as a table, as a pattern."""


def learning_fields(motion: Motion) -> list[Field]:
    """Return the views that learning takes: state, goal and action."""
    return [
        joined(motion, STATE, "observation.state"),
        joined(motion, GOAL, "observation.environment_state"),
        stored(motion, "action"),
    ]


def check_finite(output: Output, one: Trajectory) -> None:
    """Check that the fields of a trajectory hold finite numbers only.

    Raises:
        ExportError: they do not; the message names trajectory, field and row.
    """
    for field in output.fields:
        finite = np.isfinite(field.values(one.arrays)).all(axis=1)
        if not finite.all():
            where = f"{output.dataset.path}/{one.motion}: trajectory {one.index}, row {int(np.argmin(finite))}"
            raise ExportError(f"{where}: {field.name} is not finite; leave the motion out, or gather it again")


def task_sentence(motion: Motion) -> str:
    """Return in a sentence what a motion asks of the robot, from its reference in its first trajectories."""
    first = [one for one in motion.references() if one.length > 0][:1]
    arrays = ["root_orientation", "reference_root_linear_velocity", "reference_root_angular_velocity"]
    rows = next(motion.read(first, arrays)).arrays
    forward, left, _ = GOAL[2].compute(rows).mean(axis=0)
    turn = float(rows["reference_root_angular_velocity"][:, 2].mean())
    speed = float(np.hypot(forward, left))
    ways = ("forward", "to the left", "backward", "to the right")
    way = ways[round(float(np.arctan2(left, forward)) / (np.pi / 2.0)) % 4]
    parts = [f"move {way} at {speed:.1f} m/s" if speed >= 0.05 else "stay in place"]
    if abs(turn) >= 0.05:
        parts.append(f"turn {'left' if turn > 0.0 else 'right'} at {abs(turn):.1f} rad/s")
    verb = "Play once the motion" if motion.attributes.get("kind") == "once" else "Repeat the motion"
    return f"{verb} {motion.name.replace('_', ' ')}: {', '.join(parts)}."


def write_json(content: Any, path: Path, indent: int = 1) -> None:
    """Write JSON that people can read."""
    path.write_text(json.dumps(content, indent=indent))
