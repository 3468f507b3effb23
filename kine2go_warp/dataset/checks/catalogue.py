"""All checks, and their table for people."""

from itertools import groupby

from kine2go_warp.dataset.checks import commands, dynamics, kinematics, rows, store, tracking
from kine2go_warp.dataset.checks.records import Check, RowCheck
from kine2go_warp.tables import make_table, markdown

ROW_CHECKS: tuple[RowCheck, ...] = (
    *rows.CHECKS,
    *dynamics.CHECKS,
    *kinematics.CHECKS,
    *commands.CHECKS,
    *tracking.CHECKS,
)
"""Checks of rows, several to a name where several arrays are concerned."""


def all_checks() -> list[Check]:
    """Return every check once, in the order in which they run."""
    checks = [*store.STORE_CHECKS[:2], *store.MOTION_CHECKS]
    for name, group in groupby(ROW_CHECKS, key=lambda check: check.name):
        members = list(group)
        limits = dict.fromkeys(member.limit for member in members)
        checks.append(Check(name, next(one.description for one in members if one.description), ", ".join(limits)))
    return checks


def markdown_table() -> str:
    """Return the table of all checks for the documentation."""
    rows = [(check.name, check.description, check.limit) for check in all_checks()]
    return markdown(make_table("", ("check", "what must hold", "at most off by"), rows))
