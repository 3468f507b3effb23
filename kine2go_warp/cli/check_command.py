"""The command ``check``: is a dataset what it says, and do its rows agree with one another."""

import json
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from kine2go_warp.cli.data import DatasetPath, MotionNames
from kine2go_warp.cli.texts import say

if TYPE_CHECKING:
    from kine2go_warp.dataset.checks.records import Finding, Report
    from kine2go_warp.tables import Table

FOUND = 1
"""Exit status of a check that found something."""

COLOURS = {"ok": "green", "failed": "red", "skipped": "yellow"}
"""Of the states of checks."""

FEW = 3
"""Up to so many motions have a column of their own."""


@dataclass(frozen=True)
class Check:
    """Check a dataset: arrays, labels, units and attributes, and whether states, actions and rewards fit together.

    Exit status: 0 if nothing is wrong, 1 if something is, 2 if there is no dataset that could be checked.

    Example: kine2go dataset check runs/demo/dataset.zarr --physics
    """

    dataset: DatasetPath
    """The dataset, a Zarr store."""
    motions: MotionNames = ()
    """Motions to check; all if none is named."""
    physics: bool = False
    """Also take a step of plain MuJoCo from every fifth row and compare; some seconds a motion."""
    json: bool = False
    """Print everything as JSON: results, findings of every trajectory, diagnoses."""

    def run(self) -> int:
        """Check, and print a table and one line for each array that is off."""
        from rich.console import Console

        from kine2go_warp.cli.progress import bar
        from kine2go_warp.dataset import open_dataset
        from kine2go_warp.dataset.checked import save_findings
        from kine2go_warp.dataset.checks.run import check_dataset
        from kine2go_warp.scores.report import robot_note

        dataset, errors = open_dataset(self.dataset), Console(stderr=True)
        with bar("checking", errors) as advanced:
            report = check_dataset(
                self.dataset,
                dataset.robot,
                self.motions,
                lambda name, number, total: advanced(number - 1, total, name),
                self.physics,
            )
        save_findings(self.dataset, report)
        if self.json:
            print(json.dumps(report.to_json(), indent=2, allow_nan=False))
        else:
            print_report(report)
            if note := robot_note(dataset, dataset.robot):
                errors.print(f"remark: {note}", highlight=False, soft_wrap=True, markup=False)
        return 0 if report.is_clean else FOUND


def print_report(report: "Report") -> None:
    """Print the table of checks, a line for each finding, and what would explain them."""
    from kine2go_warp.cli.tables import print_table

    print_table(table_of_checks(report) if len(report.motions) <= FEW else table_of_motions(report))
    for finding, others in condensed(report.findings):
        sign = "remark" if finding.is_remark else "wrong"
        more = f"; {others} more trajectories" if others > 1 else "; one more trajectory" if others else ""
        say(f"{sign}: {finding}{more}")
    for diagnosis in report.diagnoses:
        say(f"likely: {diagnosis}")
    failed = sum(result.state == "failed" for result in report.results)
    passed = sum(result.state == "ok" for result in report.results)
    skipped = sum(result.state == "skipped" for result in report.results)
    left_out = f", {skipped} left out for want of arrays or attributes" if skipped else ""
    verdict = "clean" if report.is_clean else "not clean"
    say(f"{report.dataset}: {verdict}; {passed} checks hold, {failed} do not{left_out}")


def table_of_checks(report: "Report") -> "Table":
    """Return a table with a row for each check and a column for each motion."""
    from kine2go_warp.tables import Cell, make_table

    states = {(result.check, result.motion): result.state for result in report.results}
    rows = []
    for check in dict.fromkeys(result.check for result in report.results):
        whole = states.get((check, None), "")
        own = (worse(states.get((check, motion), ""), whole) for motion in report.motions)
        rows.append((check, *(Cell(state, style=COLOURS.get(state, "")) for state in own)))
    headings = ("check", *report.motions)
    return make_table(report.dataset, headings, rows, headings)


def table_of_motions(report: "Report") -> "Table":
    """Return a table with a row for each motion: how many checks hold, and which do not."""
    from kine2go_warp.tables import make_table

    rows = []
    for motion in (None, *report.motions):
        results = [result for result in report.results if result.motion == motion]
        count = Counter(result.state for result in results)
        failed = ", ".join(result.check for result in results if result.state == "failed")
        rows.append((motion or "(root)", *(str(count[state]) for state in ("ok", "failed", "skipped")), failed))
    headings = ("motion", "ok", "failed", "left out", "failed checks")
    return make_table(report.dataset, headings, rows, ("motion", "failed checks"))


def worse(own: str, whole: str) -> str:
    """Return the worse of two states, a motion's and the whole dataset's."""
    return "failed" if "failed" in (own, whole) else own or whole


def condensed(findings: "tuple[Finding, ...]") -> "list[tuple[Finding, int]]":
    """Return the worst finding of each check and array, and how many other trajectories have it, too."""
    groups: dict[tuple[str | None, ...], list[Finding]] = {}
    for number, finding in enumerate(findings):
        own = str(number) if finding.value is None else finding.what
        groups.setdefault((finding.motion, finding.check, finding.array, own), []).append(finding)
    return [(max(group, key=lambda one: one.value or 0.0), len(group) - 1) for group in groups.values()]
