"""Runs all checks on a dataset."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import zarr

from kine2go_warp.dataset.checks import independence, store
from kine2go_warp.dataset.checks.block import Block
from kine2go_warp.dataset.checks.catalogue import PHYSICS, ROW_CHECKS, all_checks
from kine2go_warp.dataset.checks.mistakes import diagnose
from kine2go_warp.dataset.checks.reading import READABLE, StoredMotion, blocks, common_size, motion_layout
from kine2go_warp.dataset.checks.records import Diagnosis, Finding, Report, Result, RowCheck
from kine2go_warp.dataset.store import motion_names
from kine2go_warp.errors import DatasetError
from kine2go_warp.robots import RobotSpec


def check_dataset(
    path: Path,
    spec: RobotSpec,
    motions: tuple[str, ...] = (),
    on_motion: Callable[[str, int, int], None] | None = None,
    physics: bool = False,
) -> Report:
    """Check a dataset.

    Args:
        path: Folder of the dataset.
        spec: The robot that it must be of.
        motions: Names of the motions to check; all if there is none.
        on_motion: Called with a motion's name, its number from 1, and how many there are, before it is checked.
        physics: Also take steps of plain MuJoCo from some rows, which needs its package.

    Raises:
        DatasetError: there is no dataset, it is of another format version, it holds no motion, or not the one named.
    """
    there = motion_names(path)
    if not there:
        raise DatasetError(f"{path}: a dataset without motions; add one with 'kine2go dataset gather'")
    for name in motions:
        if name not in there:
            raise DatasetError(f"{path}: holds no motion '{name}'; it has: {', '.join(there)}")
    chosen = tuple(dict.fromkeys(motions)) or tuple(there)
    run = Run(path, spec, physics)
    run.check_store()
    for number, name in enumerate(chosen, 1):
        if on_motion is not None:
            on_motion(name, number, len(chosen))
        run.check_motion(name)
    order = {check.name: place for place, check in enumerate(all_checks())}
    places = {motion: place for place, motion in enumerate((None, *chosen))}
    results = sorted(run.results, key=lambda result: (places[result.motion], order[result.check]))
    return Report(str(path), chosen, tuple(results), tuple(run.findings), tuple(run.diagnoses))


@dataclass
class Run:
    """Collects what the checks find."""

    path: Path
    spec: RobotSpec
    physics: bool = False
    results: list[Result] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    diagnoses: list[Diagnosis] = field(default_factory=list)
    seen: independence.Independence = field(default_factory=independence.Independence)

    @property
    def root(self) -> dict[str, Any]:
        """Attributes of the dataset."""
        return dict(zarr.open_group(self.path, mode="r", use_consolidated=False).attrs)

    def check_store(self) -> None:
        """Check the root."""
        self._complain(store.ROOT, None, store.check_root(self.root, self.spec))
        self._complain(store.REVIEWS, None, store.check_reviews(self.path))
        self._complain(store.INDEX, None, store.check_index(self.path))

    def check_motion(self, name: str) -> None:
        """Check one motion: its group first, then its rows."""
        try:
            motion = StoredMotion.open(self.path / name)
        except Exception as error:  # noqa: BLE001 - damaged metadata raises errors of many kinds
            self._conclude(READABLE, name, [Finding(READABLE, name, f"cannot be opened ({error.__class__.__name__})")])
            return
        layout, root = motion_layout(motion, self.spec), self.root
        self._complain(store.INDEX, name, store.check_index(self.path / name))
        self._complain(store.ARRAYS, name, store.check_arrays(motion, layout))
        self._complain(store.METADATA, name, store.check_metadata(motion, layout))
        self._complain(store.LABELS, name, store.check_labels(motion, layout))
        frequency = store.number(root, "control_frequency")
        self._complain(store.TIME, name, store.check_time(motion, frequency or None))
        try:
            count = common_size(motion, layout, "trajectory")
        except ValueError:
            count = None
        self._complain(store.ATTRIBUTES, name, store.check_attributes(motion, root, count, self.spec))
        self._check_rows(motion, root)
        if self.physics:
            from kine2go_warp.dataset.checks.physics import physics_findings

            found = physics_findings(motion, self.spec)
            if found is None:
                self.results.append(Result(PHYSICS.name, name, "skipped"))
            else:
                self._conclude(PHYSICS.name, name, found)
        self._conclude(READABLE, name, motion.findings())

    def _check_rows(self, motion: StoredMotion, root: dict[str, Any]) -> None:
        """Check the rows of a motion block by block."""
        found: dict[str, list[Finding]] = {}
        applied: set[str] = set()
        duplicates, draws, suspect = [], [], None
        for block in blocks(motion, root, self.spec):
            duplicates += self.seen.duplicates(motion.name, block)
            draws += self.seen.draws(motion.name, block)
            before = sum(map(len, found.values()))
            for check in ROW_CHECKS:
                findings = apply(check, block, motion.name)
                if findings is not None:
                    applied.add(check.name)
                    found.setdefault(check.name, []).extend(findings)
            if suspect is None and sum(map(len, found.values())) > before:
                suspect = block
        self._conclude(independence.DUPLICATES.name, motion.name, duplicates)
        self._conclude(independence.DRAWS.name, motion.name, draws)
        for name, _ in groupby(ROW_CHECKS, key=lambda check: check.name):
            if name in applied:
                self._conclude(name, motion.name, found.get(name, []))
            else:
                self.results.append(Result(name, motion.name, "skipped"))
        if suspect is not None:
            self.diagnoses += diagnose(motion.name, suspect, ROW_CHECKS)

    def _complain(self, check: store.Check, motion: str | None, complaints: Iterable[store.Complaint]) -> None:
        """Add what a check of the store found."""
        self._conclude(check.name, motion, [store.to_finding(check, motion, complaint) for complaint in complaints])

    def _conclude(self, check: str, motion: str | None, findings: list[Finding]) -> None:
        """Add the findings of a check, and whether it holds."""
        self.findings += findings
        is_ok = all(finding.is_remark for finding in findings)
        self.results.append(Result(check, motion, "ok" if is_ok else "failed"))


def apply(check: RowCheck, block: Block, motion: str) -> list[Finding] | None:
    """Return one finding for each trajectory that is off, None if the check does not apply."""
    values = check.off_by(block)
    if values is None:
        return None
    findings = []
    for index in range(block.num_trajectories):
        own = np.atleast_1d(values[index])
        off = own > check.tolerance
        if not off.any():
            continue
        row = int(np.argmax(np.where(off, own, -np.inf)))
        findings.append(
            Finding(
                check.name,
                motion,
                check.fault,
                check.array,
                trajectory=block.first + index,
                row=row if values.ndim > 1 else None,
                value=float(own[row]),
                tolerance=check.tolerance,
                unit=check.unit,
                rows=int(off.sum()) if values.ndim > 1 else 0,
            )
        )
    return findings
