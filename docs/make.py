"""The parts of the docs that are written from the code.

``uv run python docs/make.py`` writes them, between marks in the pages; with ``--check`` it names pages that differ, and
ends with status 1. Outputs of commands that take seconds are made, too (``outputs.py``). What pages show of long
commands is compared by tests instead: with the words of the code (``tests/test_pages.py``), and, in docs/first-hour.md,
with what the commands print.
"""

import re
import sys
from collections.abc import Callable
from pathlib import Path

from environment_page import environment_page
from outputs import with_outputs

from kine2go_warp.dataset.checks import catalogue
from kine2go_warp.metrics import FILTER_METRICS
from kine2go_warp.rollouts.config import GatherConfig
from kine2go_warp.scores import registry
from kine2go_warp.tables import Cell, make_table, markdown

DOCS = Path(__file__).resolve().parent


def filter_limits() -> str:
    """Return the table of the filter's limits."""
    rows = [
        (
            Cell(one.name, code=True),
            one.unit,
            f"{getattr(GatherConfig(), one.setting):,g}",
            Cell(f"--{one.setting.replace('_', '-')}", code=True),
            one.description,
        )
        for one in FILTER_METRICS
    ]
    return markdown(make_table("", ("metric", "unit", "limit", "option", "what it is"), rows))


PARTS: dict[str, Callable[[], str]] = {
    "checks.md": catalogue.markdown_table,
    "filtering.md": filter_limits,
    "scores.md": registry.markdown_table,
}
"""Tables by the page that has them, between ``<!-- docs/make.py -->`` and ``<!-- end -->``."""

MARKED = re.compile(r"(<!-- docs/make.py -->\n).*?(\n<!-- end -->)", re.DOTALL)


def pages() -> dict[Path, str]:
    """Return the pages as they should be.

    Raises:
        ValueError: a page has no marks.
    """
    made = {DOCS / "environment.md": environment_page()}
    for name, make in PARTS.items():
        path, table = DOCS / name, make().strip()
        made[path], found = MARKED.subn(lambda marks, table=table: f"{marks[1]}{table}{marks[2]}", path.read_text())
        if found != 1:
            raise ValueError(f"{path}: needs one part between '<!-- docs/make.py -->' and '<!-- end -->', has {found}")
    for path in sorted(DOCS.glob("*.md")):
        text = made.get(path, path.read_text())
        if (shown := with_outputs(text)) != text or path in made:
            made[path] = shown
    return made


def main(arguments: list[str]) -> int:
    """Write the pages, or compare them, and return the exit status."""
    stale = {path: text for path, text in pages().items() if path.read_text() != text}
    for path, text in stale.items():
        if "--check" in arguments:
            print(f"docs/{path.name}: is not what the code says; run: uv run python docs/make.py")
        else:
            path.write_text(text)
            print(f"docs/{path.name}: written")
    return int("--check" in arguments and bool(stale))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
