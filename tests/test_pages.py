"""Pages that repeat what the code says."""

import re

from tests.conftest import REPOSITORY


def source_texts() -> str:
    """The texts of the package, those that a line break parts joined."""
    rooms = ("kine2go_warp", "kernels", "motions", "pipelines", "robots")
    files = {path.resolve() for room in rooms for path in (REPOSITORY / room).rglob("*.py")}
    return "\n".join(re.sub(r'"\s*\n\s*f?"', "", path.read_text()) for path in sorted(files))


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
