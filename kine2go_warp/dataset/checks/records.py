"""What a check is, what it finds, and the report of all of them."""

import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.checks.block import Block


@dataclass(frozen=True)
class Check:
    """One idea of what must hold."""

    name: str
    """A few words, such as ``forward kinematics``."""
    description: str
    """What must hold, in one line."""
    limit: str
    """How far it may be off, as text for people."""


@dataclass(frozen=True)
class RowCheck:
    """A check that is a number for each row, or for each trajectory, and a limit for it."""

    name: str
    """Several row checks of one name, for different arrays, are one check."""
    array: str
    """The array to blame."""
    needs: tuple[str, ...]
    """Arrays that are read; without one of them the check is left out."""
    description: str
    """What must hold, in one line."""
    fault: str
    """What is said of an array that fails; followed by "by" and the number, after a colon by the number alone."""
    measure: Callable[[Block], NDArray[np.float64] | None]
    """Returns how far off the rows are, shape [num_trajectories, num_rows] (or one row fewer), or the trajectories,
    shape [num_trajectories]; NaN where there is nothing to say. None if the motion's attributes do not hold what is
    needed."""
    tolerance: float
    """More than this is a finding."""
    unit: str = ""

    @property
    def limit(self) -> str:
        """How far it may be off, as text for people."""
        return f"{self.tolerance:g} {self.unit}".strip()

    def off_by(self, block: Block) -> NDArray[np.float64] | None:
        """Return what ``measure`` does, None also if an array that it needs is not there."""
        if any(name not in block for name in self.needs):
            return None
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            values = self.measure(block)
        return None if values is None else np.nan_to_num(values, nan=np.nan, posinf=np.finfo(float).max)


@dataclass(frozen=True)
class Finding:
    """Something wrong, or worth a remark, at one place of a dataset."""

    check: str
    """Name of the check."""
    motion: str | None
    """None: the dataset as a whole."""
    what: str
    """What is wrong."""
    array: str | None = None
    trajectory: int | None = None
    row: int | None = None
    """The worst row of the trajectory."""
    value: float | None = None
    """How far off it is."""
    tolerance: float | None = None
    """How far off it may be."""
    unit: str = ""
    rows: int = 0
    """Number of rows of the trajectory that are off."""
    is_remark: bool = False
    """Whether it is only worth knowing; the dataset is clean all the same."""

    @property
    def place(self) -> str:
        """Where it is, such as ``dog_trot/action, trajectory 3, row 17``."""
        path = "/".join(part for part in (self.motion, self.array) if part) or "dataset"
        trajectory = "" if self.trajectory is None else f", trajectory {self.trajectory}"
        return path + trajectory + ("" if self.row is None else f", row {self.row}")

    def __str__(self) -> str:
        amount = ""
        if self.value is not None and self.tolerance is not None:
            joint = " " if self.what.endswith(":") else " by "
            amount = f"{joint}{self.value:.3g}" + f" {self.unit}".rstrip() + f" (at most {self.tolerance:g})"
        return f"{self.place}: {self.what}{amount} [{self.check}]"


@dataclass(frozen=True)
class Diagnosis:
    """A mistake that would explain findings: undoing it fixes them."""

    motion: str
    what: str
    """The mistake, such as ``joint_position is in degrees``."""
    fixes: tuple[str, ...]
    """Names of the checks that hold when it is undone."""
    failed: int
    """Number of checks that fail as the data are."""

    def __str__(self) -> str:
        return (
            f"{self.motion}: it looks as if {self.what}: undoing that fixes {len(self.fixes)} of {self.failed} "
            f"failed checks ({'; '.join(self.fixes)})"
        )


@dataclass(frozen=True)
class Result:
    """What one check found in one motion."""

    check: str
    motion: str | None
    """None: the dataset as a whole."""
    state: Literal["ok", "failed", "skipped"]
    """``skipped``: arrays or attributes that the check needs are not there."""


@dataclass(frozen=True)
class Report:
    """What all checks found in a dataset."""

    dataset: str
    motions: tuple[str, ...]
    results: tuple[Result, ...]
    findings: tuple[Finding, ...]
    diagnoses: tuple[Diagnosis, ...] = ()

    @property
    def is_clean(self) -> bool:
        """Whether nothing is wrong; remarks do not count."""
        return all(finding.is_remark for finding in self.findings)

    def to_json(self) -> dict[str, Any]:
        """Return everything as plain lists and dictionaries."""
        return {"clean": self.is_clean, **asdict(self)}
