"""Tables of results: what stands in each cell. One printer each makes them text, Markdown or HTML.

``cli.tables.print_table`` prints them in a terminal, ``markdown`` is for documents, and the page of a report has a
template of its own.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Cell:
    """One cell of a table."""

    text: str
    value: float | str | None = None
    """What it is sorted by; nothing where there is no value."""
    name: str = ""
    """Which metric it is."""
    hint: str = ""
    """Shown when pointed at."""
    code: bool = False
    """Whether it is a name of the software's, such as a motion's."""
    style: str = ""
    """Colour in a terminal, or a class of the page's style."""
    bar: float | None = None
    """Share from 0 to 1 that a page draws as a bar."""

    @property
    def is_number(self) -> bool:
        """Whether it is set to the right."""
        return isinstance(self.value, float)


@dataclass(frozen=True)
class Column:
    """The heading of a column."""

    text: str
    unit: str = ""
    hint: str = ""
    number: bool = True
    """Whether it is set to the right and never folded; texts fold where a terminal is narrow."""

    @property
    def heading(self) -> str:
        """Text and unit."""
        return f"{self.text} [{self.unit}]" if self.unit else self.text


@dataclass(frozen=True)
class Table:
    """A table of results."""

    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    total: tuple[Cell, ...] = ()
    """A last row that stays where it is."""
    title: str = ""


def make_table(
    title: str, columns: Sequence[str | Column], rows: Iterable[Sequence[object]], texts: Sequence[str] = ()
) -> Table:
    """Return a table of cells, or of values as they are printed.

    Args:
        title: Its title.
        columns: Headings; a unit stands in the heading's text.
        rows: Cells in the order of the headings.
        texts: Headings of the columns that hold texts rather than numbers.
    """
    made = tuple(one if isinstance(one, Column) else Column(one, number=one not in texts) for one in columns)
    cells = tuple(tuple(one if isinstance(one, Cell) else Cell(str(one)) for one in row) for row in rows)
    return Table(made, cells, title=title)


def markdown(table: Table) -> str:
    """Return a table in Markdown, without its title."""
    rows = [[Cell(column.heading) for column in table.columns], *table.rows, table.total]
    lines = ["| " + " | ".join(_markdown_cell(one) for one in row) + " |" for row in rows if row]
    lines.insert(1, "|" + "---|" * len(table.columns))
    return "\n".join(lines) + "\n"


def _markdown_cell(cell: Cell) -> str:
    """Return the text of a cell with what Markdown would take for the edge of a column escaped."""
    text = cell.text.replace("|", "\\|")
    return f"`{text}`" if cell.code else text


def number_text(value: float) -> str:
    """Return a number with three significant digits, whole ones and those from 1,000 on in full."""
    if math.isnan(value):
        return "-"
    if abs(value) >= 1000.0 or value == int(value):
        return f"{value:,.0f}"
    return f"{value:.3g}"


def known(text: str) -> str:
    """Return the text of a cell with numbers, empty where one is not known (NaN)."""
    return "" if "nan" in text else text


def counted(count: int, noun: str) -> str:
    """Return a number of things in words, such as ``1 trajectory`` or ``2 trajectories``."""
    ending = {"y": "ies", "h": "hes"}.get(noun[-1], f"{noun[-1]}s")
    plural = noun[:-1] + ending
    return f"{count:,} {noun if count == 1 else plural}"
