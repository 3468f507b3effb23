"""Tables in a terminal: at any width every number and name can be read, and no text is taken for markup."""

import io

import pytest
from rich.console import Console

from kine2go_warp.cli.main import main
from kine2go_warp.cli.tables import print_table
from kine2go_warp.motions.catalogue import motion_named
from kine2go_warp.tables import Cell, Column, make_table, markdown

NAMES = ("vhdc_horse1_s1_walk_01", "ai4_dog_synth_circle_walk", "solo8_leap")
HEADINGS = ("motion", "frames", "speed [m/s]", "joint RMSE [rad]", "seam score", "below floor [mm]", "slip [m/s]",
            "remarks")  # fmt: skip
REMARK = "the left hind foot slides in every cycle"


def printed(table, width: int) -> str:
    """What a terminal of a width shows."""
    file = io.StringIO()
    print_table(table, Console(file=file, width=width, legacy_windows=False))
    return file.getvalue()


def wide():
    """A table with texts of its own in every cell, so that each can be found again."""
    rows = [
        (name, f"{k}10-{k}71", f"1.23{k}", f"0.0456{k}", f"7.8{k}", f"9.1{k}", f"0.23{k}4", REMARK)
        for k, name in enumerate(NAMES, 1)
    ]
    return make_table("runs/clips", HEADINGS, rows, ("motion", "remarks"))


@pytest.mark.parametrize("width", [40, 60, 80, 100, 140, 200])
def test_digits_and_names_are_never_cut_at_any_width(width):
    output = printed(wide(), width)
    assert "…" not in output
    for row in wide().rows:
        for cell in row[:-1]:
            assert cell.text in output
    for heading in HEADINGS[1:]:
        for word in heading.split():
            assert word in output


def test_a_table_becomes_blocks_where_it_does_not_fit():
    assert max(map(len, printed(wide(), 120).splitlines())) <= 120
    assert "│" in printed(wide(), 120)
    narrow = printed(wide(), 40)
    assert "│" not in narrow
    assert "  speed [m/s]: 1.231" in narrow.splitlines()


@pytest.mark.parametrize("text", ["br/[/x]/d.zarr", "br/[red]x/d.zarr", "[bold]", "a[/]b"])
def test_nothing_is_taken_for_markup(text):
    table = make_table(text, (text, "n [1]"), [(text, Cell(text, style="red"))], (text,))
    for width in (20, 140):
        assert printed(table, width).count(text) >= 3
    assert text in markdown(table)


def test_a_table_in_markdown_has_units_code_and_the_total():
    table = make_table("", (Column("motion", number=False), Column("speed", "m/s")), [(Cell("walk", code=True), "1.2")])
    assert markdown(table) == "| motion | speed [m/s] |\n|---|---|\n| `walk` | 1.2 |\n"


def test_no_rows_are_a_table_of_headings():
    assert "frames" in printed(make_table("", ("frames",), []), 80)


def test_what_a_clip_does_not_have_is_an_empty_cell(tmp_path, capsys):
    """A motion that is played once has no seam; the name of this one is no missing number."""
    table = tmp_path / "table.md"
    own = ["--name", "nancy", "--once", "--frames", "0:60", "--licence", "own", "--markdown", str(table)]
    file = motion_named("dog_trot").path(None)
    assert main(["motion", "retarget", str(file), *own, "--out", str(tmp_path / "clips")]) in (0, 2)
    headings, _, row = [line.split(" | ") for line in table.read_text().splitlines()]
    cells = dict(zip(headings, row, strict=True))
    assert cells["| motion"] == "| `nancy`"
    assert (cells["seam [m/s^2]"], cells["seam, strides"]) == ("", "")
    assert float(cells["slip [m/s]"]) >= 0.0
    shown = capsys.readouterr().out.replace("nancy", "")
    assert "slip" in shown
    assert "nan" not in shown
