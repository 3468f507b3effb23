"""What the last check found in each motion, kept in the dataset's folder; it holds for the content that was checked."""

import contextlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kine2go_warp.dataset.content import motion_content
from kine2go_warp.errors import DatasetError
from kine2go_warp.files import atomic_file

if TYPE_CHECKING:
    from kine2go_warp.dataset.checks.records import Report

FILE = "checked.json"


def save_findings(path: Path, report: "Report") -> None:
    """Write which checks failed in the motions of a report, where the dataset can be written to."""
    known = read_findings(path)
    for motion in report.motions:
        wrong = [one.check for one in report.findings if one.motion in (None, motion) and not one.is_remark]
        with contextlib.suppress(DatasetError):
            known[motion] = {"content": motion_content(path, motion), "wrong": list(dict.fromkeys(wrong))}
    with contextlib.suppress(OSError), atomic_file(path / FILE) as temporary:
        temporary.write_text(json.dumps(known, indent=1))


def read_findings(path: Path) -> dict[str, Any]:
    """Return what the file says of each motion; nothing where there is none or it is damaged."""
    try:
        known = json.loads((path / FILE).read_text())
    except (OSError, ValueError):
        return {}
    return known if isinstance(known, dict) else {}


def check_note(path: Path, motions: Sequence[str]) -> str:
    """Return in one line what the last check found wrong in some motions, or that it has not seen them as they are.

    It is empty where all are clean.
    """
    known, wrong, unseen = read_findings(path), [], []
    for motion in motions:
        one = known.get(motion)
        if not isinstance(one, dict) or one.get("content") != motion_content(path, motion):
            unseen.append(motion)
        elif one.get("wrong"):
            wrong.append(f"{motion} ({', '.join(map(str, one['wrong']))})")
    parts = [f"'kine2go dataset check' found faults in {', '.join(wrong)}"] if wrong else []
    if unseen:
        few = ", ".join(unseen[:3]) + (f" and {len(unseen) - 3} more" if len(unseen) > 3 else "")
        parts.append(f"not checked since the data were written: {few}; run 'kine2go dataset check'")
    return "; ".join(parts)
