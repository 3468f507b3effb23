"""The command ``check``: is a dataset what it says, and do its rows agree with one another."""

import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

if TYPE_CHECKING:
    from rich.table import Table

    from kine2go_warp.dataset.checks.records import Finding, Report

Positional = tyro.conf.Positional

FOUND = 1
"""Exit status of a check that found something."""

FEW = 3
"""Up to so many motions have a column of their own."""


@dataclass(frozen=True)
class Check:
    """Check a dataset: arrays, labels, units and attributes, and whether states, actions and rewards fit together.

    Exit status: 0 if nothing is wrong, 1 if something is, 2 if there is no dataset that could be checked.
    """

    dataset: Positional[Path]
    """The dataset, a Zarr store."""
    motions: Positional[tuple[str, ...]] = ()
    """Motions to check; all if none is named."""
    json: bool = False
    """Print everything as JSON: results, findings of every trajectory, diagnoses."""

    def run(self) -> int:
        """Check, and print a table and one line for each array that is off."""
        from rich.console import Console
        from rich.progress import Progress, TextColumn

        from kine2go_warp.dataset.checks.run import check_dataset
        from kine2go_warp.robots import GO2
        from kine2go_warp.scores.report import robot_note

        errors = Console(stderr=True)
        with Progress(*Progress.get_default_columns(), TextColumn("{task.fields[motion]}"), console=errors,
                      transient=True, disable=not errors.is_terminal) as progress:  # fmt: skip
            task = progress.add_task("checking", motion="", total=None)
            report = check_dataset(
                self.dataset,
                GO2,
                self.motions,
                lambda name, number, total: progress.update(task, completed=number - 1, total=total, motion=name),
            )
        if self.json:
            print(json.dumps(report.to_json(), indent=2, allow_nan=False))
        else:
            print_report(report)
            if note := robot_note(self.dataset, GO2):
                errors.print(f"remark: {note}", highlight=False, soft_wrap=True, markup=False)
        return 0 if report.is_clean else FOUND


def print_report(report: "Report") -> None:
    """Print the table of checks, a line for each finding, and what would explain them."""
    from kine2go_warp.cli.tables import console

    output = console()
    table = table_of_checks(report) if len(report.motions) <= FEW else table_of_motions(report)
    output.print(table)
    for finding, others in condensed(report.findings):
        sign = "remark" if finding.is_remark else "wrong"
        more = f"; {others} more trajectories" if others > 1 else "; one more trajectory" if others else ""
        output.print(f"{sign}: {finding}{more}", highlight=False, soft_wrap=True, markup=False)
    for diagnosis in report.diagnoses:
        output.print(f"likely: {diagnosis}", highlight=False, soft_wrap=True, markup=False)
    failed = sum(result.state == "failed" for result in report.results)
    passed = sum(result.state == "ok" for result in report.results)
    skipped = sum(result.state == "skipped" for result in report.results)
    left_out = f", {skipped} left out for want of arrays or attributes" if skipped else ""
    verdict = "clean" if report.is_clean else "not clean"
    output.print(f"{report.dataset}: {verdict}; {passed} checks hold, {failed} do not{left_out}", soft_wrap=True)


def table_of_checks(report: "Report") -> "Table":
    """Return a table with a row for each check and a column for each motion."""
    from rich.table import Table

    table = Table(title=report.dataset, title_justify="left")
    for heading in ("check", *report.motions):
        table.add_column(heading)
    states = {(result.check, result.motion): result.state for result in report.results}
    for check in dict.fromkeys(result.check for result in report.results):
        whole = states.get((check, None), "")
        table.add_row(check, *(styled(worse(states.get((check, motion), ""), whole)) for motion in report.motions))
    return table


def table_of_motions(report: "Report") -> "Table":
    """Return a table with a row for each motion: how many checks hold, and which do not."""
    from rich.table import Table

    table = Table(title=report.dataset, title_justify="left")
    for heading in ("motion", "ok", "failed", "left out", "failed checks"):
        table.add_column(heading, justify="left" if heading in ("motion", "failed checks") else "right")
    for motion in (None, *report.motions):
        results = [result for result in report.results if result.motion == motion]
        count = Counter(result.state for result in results)
        failed = ", ".join(result.check for result in results if result.state == "failed")
        table.add_row(motion or "(root)", *(str(count[state]) for state in ("ok", "failed", "skipped")), failed)
    return table


def worse(own: str, whole: str) -> str:
    """Return the worse of two states, a motion's and the whole dataset's."""
    return "failed" if "failed" in (own, whole) else own or whole


def styled(state: str) -> str:
    """Return a state in its colour."""
    colours = {"ok": "green", "failed": "red", "skipped": "yellow"}
    return f"[{colours[state]}]{state}[/]" if state in colours else state


def condensed(findings: "tuple[Finding, ...]") -> "list[tuple[Finding, int]]":
    """Return the worst finding of each check and array, and how many other trajectories have it, too."""
    groups: dict[tuple[str | None, ...], list[Finding]] = {}
    for number, finding in enumerate(findings):
        own = str(number) if finding.value is None else finding.what
        groups.setdefault((finding.motion, finding.check, finding.array, own), []).append(finding)
    return [(max(group, key=lambda one: one.value or 0.0), len(group) - 1) for group in groups.values()]
