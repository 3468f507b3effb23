"""All checks, and their table for people."""

from itertools import groupby

from kine2go_warp.dataset.checks import commands, drawn, dynamics, kinematics, loads, rows, store, tracking
from kine2go_warp.dataset.checks.records import Check, RowCheck
from kine2go_warp.tables import make_table, markdown

ROW_CHECKS: tuple[RowCheck, ...] = (
    *rows.CHECKS,
    *dynamics.CHECKS,
    *kinematics.CHECKS,
    *commands.CHECKS,
    *tracking.CHECKS,
    *drawn.CHECKS,
    *loads.CHECKS,
)
"""Checks of rows, several to a name where several arrays are concerned."""

PHYSICS_LIMITS = {
    "joint_position": (1e-5, "rad"), "joint_velocity": (1e-3, "rad/s"), "root_linear_velocity": (1e-4, "m/s"),
    "root_angular_velocity": (1e-3, "rad/s"),
    "joint_torque": (1e-2, "N m"), "foot_contact_force": (0.5, "N"), "joint_torque_mean": (1e-2, "N m"),
    "joint_torque_peak": (1e-2, "N m"), "joint_power_mean": (0.2, "W"), "joint_power_peak": (0.2, "W"),
    "friction_anchor": (1e-4, "rad"),
}  # fmt: skip
"""How far a row may be from where plain MuJoCo's step leads. Typical are 1e-7 rad, 4e-6 rad/s, 6e-8 m/s, 1e-5 N m and
7e-5 N: what single precision leaves."""

PHYSICS_STRIDE = 5
"""Rows from one step of plain MuJoCo to the next."""

PHYSICS = Check(
    "physics",
    f"with `--physics`: a step of plain MuJoCo from every {PHYSICS_STRIDE}th row leads to the next row (flat ground)",
    ", ".join(f"{limit:g} {unit}" for limit, unit in PHYSICS_LIMITS.values()),
)


def all_checks() -> list[Check]:
    """Return every check once, in the order in which they run."""
    checks = [*store.STORE_CHECKS[:2], *store.MOTION_CHECKS]
    for name, group in groupby(ROW_CHECKS, key=lambda check: check.name):
        members = list(group)
        limits = dict.fromkeys(member.limit for member in members)
        checks.append(Check(name, next(one.description for one in members if one.description), ", ".join(limits)))
    return [*checks, PHYSICS]


def markdown_table() -> str:
    """Return the table of all checks for the documentation."""
    rows = [(check.name, check.description, check.limit) for check in all_checks()]
    return markdown(make_table("", ("check", "what must hold", "at most off by"), rows))
