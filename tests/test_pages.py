"""Pages that repeat what the code says."""

import ast
import re
import runpy

import pytest

from kine2go_warp import __version__
from tests.conftest import REPOSITORY
from tests.test_first_hour import FENCE, PAGES

LEAST_WORDS = 9
"""Letters that a text must have of its own to be told from others."""

MADE = re.compile(r"<!-- docs/make.py: output -->\n```.*?\n```\n", re.DOTALL)

SHORT = ("up to date", "trajectory rejected")
"""Ends of sentences that are made of values alone."""


def source_files() -> list[str]:
    """The texts of the package's files."""
    rooms = ("kine2go_warp", "kernels", "motions", "pipelines", "robots")
    files = {path.resolve() for room in rooms for path in (REPOSITORY / room).rglob("*.py")}
    return [path.read_text() for path in sorted(files)]


def source_texts() -> str:
    """The texts of the package, those that a line break parts joined."""
    return "\n".join(re.sub(r'"\s*\n\s*f?"', "", text) for text in source_files())


@pytest.fixture
def make(monkeypatch):
    """The names of docs/make.py."""
    monkeypatch.syspath_prepend(str(REPOSITORY / "docs"))
    return runpy.run_path(str(REPOSITORY / "docs" / "make.py"))


def test_what_is_written_from_the_code_is_what_the_code_says(make, capsys):
    assert make["main"](["--check"]) == 0, capsys.readouterr().out


def test_a_page_that_is_stale_is_named_and_written_anew(make, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(make["pages"].__globals__, "with_outputs", lambda text: text)  # which takes seconds
    for path in make["pages"]():
        (tmp_path / path.name).write_text(path.read_text().replace("0.4", "0.5"))
    monkeypatch.setitem(make["pages"].__globals__, "DOCS", tmp_path)
    assert make["main"](["--check"]) == 1
    assert "docs/filtering.md: is not what the code says" in capsys.readouterr().out
    assert make["main"]([]) == 0
    assert make["main"](["--check"]) == 0


def test_stale_output_is_made_again_and_other_blocks_stay(monkeypatch):
    monkeypatch.syspath_prepend(str(REPOSITORY / "docs"))
    from outputs import with_outputs

    block = "```\n$ kine2go --version\nkine2go 0.0.0\n$ kine2go trian\n```\n"
    page = with_outputs(f"{block}<!-- docs/make.py: output -->\n{block}")
    kept, _, made = page.partition("<!-- docs/make.py: output -->\n")
    assert kept == block
    lines = made.splitlines()
    assert lines[1:3] == ["$ kine2go --version", f"kine2go {__version__}"]
    assert lines[4].startswith("kine2go: error: unknown command 'trian'")
    assert lines[-1] == "```"


@pytest.fixture(scope="module")
def printed():
    """Patterns of the sentences that the package can print, with anything in the place of values."""
    patterns = set()
    for node in (node for text in source_files() for node in ast.walk(ast.parse(text))):
        if isinstance(node, ast.JoinedStr):
            parts = [one.value if isinstance(one, ast.Constant) else None for one in node.values]
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and "\n" not in node.value:
            parts = [part or None for part in re.split(r"{[^}]*}", node.value)]
        else:
            continue
        words = [re.escape(one) if isinstance(one, str) else ".*" for one in parts]
        if sum(len(one.strip()) for one in parts if isinstance(one, str)) >= LEAST_WORDS:
            patterns.add("".join(words).replace("\\\n", ""))
    return [re.compile(one) for one in patterns]


def shown_sentences(page: str) -> list[str]:
    """The lines that a page shows as output of our commands, without tables, their titles, and what a person types.

    Blocks that ``docs/make.py`` makes are compared as they are.
    """
    found = []
    for _, block in FENCE.findall(MADE.sub("", page)):
        lines = block.splitlines() if block.startswith("$ kine2go") else []
        for line, after in zip(lines, [*lines, ""][1:], strict=True):
            is_table = line[:1] in "│┃┏┡├└╇ " or after[:1] == "┏"
            if line and not is_table and not line.startswith(("$ ", "> ", "why: ", "...")):
                found.append(line.removeprefix("kine2go: error: "))
    return found


@pytest.mark.parametrize("path", [one for one in PAGES if shown_sentences(one.read_text())], ids=lambda one: one.name)
def test_the_output_on_pages_is_in_the_words_of_the_code(path, printed):
    """Numbers may be of another day; docs/first-hour.md is compared with what its commands print."""
    sentences = [one for one in shown_sentences(path.read_text()) if not one.endswith(SHORT)]
    # Messages about a dataset may be printed as ``NAME: message``; the code then has the message alone.
    forms = {one: (one, one.partition(": ")[2]) for one in sentences}
    unknown = [
        one for one in sentences if not any(pattern.fullmatch(form) for pattern in printed for form in forms[one])
    ]
    assert unknown == []


def test_output_in_other_words_would_be_found(printed):
    for old, new in (("pictures of", "frames of"), ("checks hold, 0 do not", "checks pass")):
        lines = [line for path in PAGES for line in shown_sentences(path.read_text()) if old in line]
        assert lines
        for line in lines:
            assert not any(pattern.fullmatch(line.replace(old, new)) for pattern in printed)


def test_the_messages_of_the_page_on_errors_are_those_of_the_code():
    page = (REPOSITORY / "docs" / "troubleshooting.md").read_text()
    messages = re.findall(r"^\| `(.+?)` \|", page, re.MULTILINE)
    texts = source_texts()
    assert len(messages) > 10
    assert [message for message in messages if message not in texts] == []


def test_every_page_is_linked_from_the_front_page():
    front = (REPOSITORY / "docs" / "index.md").read_text()
    pages = {path.name for path in (REPOSITORY / "docs").glob("*.md")} - {"index.md"}
    assert {page for page in pages if f"({page})" not in front} == set()
