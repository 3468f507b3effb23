"""Texts as a terminal takes them: no control characters, and commands as they can be entered here."""

import os
import re
import sys

CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069]")
"""Characters that drive a terminal or turn the direction of writing; tabs and ends of lines are none of them."""


def printable(text: str) -> str:
    r"""Return a text with its control characters as escapes, such as ``\x1b``: texts of files are not trusted."""
    return CONTROL.sub(lambda match: match.group().encode("unicode_escape").decode(), text)


def command_prefix() -> str:
    """Return what goes before a command of this environment: ``uv run`` where this one was started so."""
    return "uv run " if "UV_RUN_RECURSION_DEPTH" in os.environ else ""


def sentence(text: str) -> str:
    """Return a message as it is printed: the commands that it names work as they stand there."""
    return printable(text).replace("'kine2go ", f"'{command_prefix()}kine2go ")


def say(text: str, error: bool = False) -> None:
    """Print a text as it is, at once, to standard output or standard error."""
    print(sentence(text), file=sys.stderr if error else sys.stdout, flush=True)
