"""A report, read as an HTML parser reads it."""

from dataclasses import dataclass, field
from html.parser import HTMLParser

import pytest

from kine2go_warp.reports.report import write_report


@dataclass
class Cell:
    """A cell of a table."""

    tag: str
    attributes: dict
    text: str = ""


@dataclass
class Page(HTMLParser):
    """What is in a page."""

    html: str
    tables: dict[str, list[list[Cell]]] = field(default_factory=dict)
    """Rows of cells by the table's label."""
    elements: list[tuple[str, dict]] = field(default_factory=list)
    """Every element with its attributes."""
    open_elements: list[str] = field(default_factory=list)

    def __post_init__(self):
        super().__init__()
        self.label, self.cell = "", None
        self.feed(self.html)
        self.close()

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.elements.append((tag, attributes))
        if tag not in ("meta", "link", "img", "br", "wbr", "use", "path"):
            self.open_elements.append(tag)
        if attributes.get("class") == "scroll":
            self.label = attributes["aria-label"]
            self.tables[self.label] = []
        elif tag == "tr":
            self.tables[self.label].append([])
        elif tag in ("td", "th"):
            self.cell = Cell(tag, attributes)
            self.tables[self.label][-1].append(self.cell)

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        if tag in ("path", "use"):
            return
        assert self.open_elements.pop() == tag, f"</{tag}> at {self.getpos()}"
        if tag in ("td", "th"):
            self.cell = None

    def handle_data(self, data):
        if self.cell is not None:
            self.cell.text += data

    def all(self, name):
        """Attributes of all elements of a kind."""
        return [attributes for tag, attributes in self.elements if tag == name]


@pytest.fixture(scope="session")
def report(walks, tmp_path_factory):
    """The report of a dataset of two motions; without pictures where none can be drawn."""
    path = tmp_path_factory.mktemp("report") / "walks.html"
    write_report(walks, path)
    return path


@pytest.fixture(scope="session")
def page(report):
    return Page(report.read_text())
