"""``kine2go dataset report`` as a person meets it."""

import pytest

from kine2go_warp.cli.main import main


def failing(capsys, *arguments):
    """Run a command that must fail, and return its one line."""
    assert main(["report", *map(str, arguments)]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    return lines[0]


def test_a_report_is_written_once_and_replaced_when_asked(walks, tmp_path, capsys):
    out = tmp_path / "page.html"
    assert main(["report", str(walks), "walk", "--out", str(out), "--no-pictures"]) == 0
    output = capsys.readouterr().out
    assert "3 trajectories of 1 motion," in output
    first = out.read_text()
    assert "--overwrite" in failing(capsys, walks, "--out", out)
    assert out.read_text() == first
    assert main(["report", str(walks), "--out", str(out), "--no-pictures", "--overwrite"]) == 0
    assert "stroll" in out.read_text()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("wolf", "--out", "a.html"), "no motion 'wolf'; it has: stroll, walk"),
        (("--out", "a.pdf"), "a report ends in .html, not '.pdf'"),
        (("--out", "nowhere/a.html"), "nowhere: no such folder"),
        (("--out", "folder.html"), "is a folder"),
    ],
)
def test_wrong_input_gets_one_line_and_leaves_nothing(walks, tmp_path, monkeypatch, capsys, arguments, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.html").mkdir()
    assert message in failing(capsys, walks, *arguments)
    assert [one.name for one in tmp_path.iterdir()] == ["folder.html"]


def test_what_is_no_dataset_gets_one_line(tmp_path, capsys):
    assert "no dataset here" in failing(capsys, tmp_path / "nothing.zarr")
