"""Robots by name, or by reference to a robot in a user's own Python file or module."""

from dataclasses import replace
from functools import cache
from pathlib import Path

from kine2go_warp.errors import Kine2GoError
from kine2go_warp.objects import load_object
from kine2go_warp.robots.check import check_robot
from kine2go_warp.robots.spec import RobotSpec

DEFAULT_ROBOT = "go2"
"""Also the robot of files that name none: they are older than the choice."""

ROBOTS = {name: f"kine2go_warp.robots.{name}:{name.upper()}" for name in (DEFAULT_ROBOT, "a1", "go1", "b2")}
"""Where the package's robots are defined, by name; each is loaded when it is first used."""


@cache
def robot_named(name: str) -> RobotSpec:
    """Return a robot.

    Args:
        name: One of ``ROBOTS``, or a reference to a robot of one's own: ``my_robot.py:SPEC`` or ``my_lab.robots:SPEC``.
            Python in that file or module is run.

    Raises:
        Kine2GoError: there is no such robot, or what is there fails ``check_robot``.
    """
    if name in ROBOTS:
        return load_object(ROBOTS[name])
    where, colon, attribute = name.rpartition(":")
    if not colon:
        known = ", ".join(sorted(ROBOTS))
        raise Kine2GoError(f"unknown robot '{name}'; known are: {known}, or FILE.py:NAME for a robot of your own")
    spec = load_object(name)
    if not isinstance(spec, RobotSpec):
        raise Kine2GoError(f"{where}: {attribute} is no RobotSpec but a {type(spec).__name__}")
    check_robot(spec, name)
    # Files outlive the folder that a command is run in.
    return replace(spec, defined_in=f"{Path(where).resolve()}:{attribute}" if where.endswith(".py") else name)


def stored_robot(name: str, where: str) -> RobotSpec:
    """Return the robot that a file names.

    Args:
        name: As stored.
        where: The file, for the message.

    Raises:
        Kine2GoError: the robot cannot be had here.
    """
    try:
        return robot_named(name)
    except Kine2GoError as error:
        raise Kine2GoError(f"{where}: its robot is not available here: {error}") from None
