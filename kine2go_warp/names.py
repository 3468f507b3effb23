"""Names that become files, folders and groups of a dataset."""

import re
from collections.abc import Sequence

from kine2go_warp.errors import Kine2GoError

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")
RESERVED = re.compile(r"(?i)(con|nul|aux|prn)(\..*)?|.*\.json")
"""Devices of some systems, and names that files of a dataset or a run have."""
LONGEST = 100


def check_name(name: object, where: object, kind: type[Kine2GoError]) -> None:
    """Refuse a name that would lead out of a folder, or that terminals and file systems do not take.

    Raises:
        Kine2GoError: of the kind given, with the place.
    """
    if not isinstance(name, str) or not NAME.fullmatch(name) or len(name) > LONGEST:
        raise kind(
            f"{where}: {name!r:.120} is no name for a motion; use at most {LONGEST} letters, digits and '_ - .', "
            "beginning with a letter or digit"
        )
    if RESERVED.fullmatch(name):
        raise kind(f"{where}: {name!r} is a name that other files have; choose another one for the motion")


def check_distinct(names: Sequence[str], kind: type[Kine2GoError]) -> None:
    """Refuse clips of one name, which would be written to one place.

    Raises:
        Kine2GoError: of the kind given.
    """
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise kind(f"two clips are named '{twice}'; name each once, or give one of them another name")
