"""What comes first: errors before what is slow to import, and texts of files that no terminal obeys."""

import json
import shutil
import subprocess
import sys

import pytest

from kine2go_warp.__main__ import entry_point
from kine2go_warp.cli.main import main

NOTHING_THERE = (
    *(
        "policy train nope.npz",
        "policy ablate nope.npz",
        "policy eval nope",
        "policy sim2sim nope",
        "policy export nope",
    ),
    *("dataset gather nope", "dataset check nope", "dataset review nope", "dataset score nope", "dataset quality nope"),
    *("dataset replay nope", "dataset report nope", "dataset render nope dog_trot 0 --out a.mp4"),
    *("dataset benchmark nope --policy a.onnx", "dataset export nope", "dataset publish nope --to there"),
    *("motion export nope.npz --out there", "motion retarget nope.bvh --licence own", "motion cycles nope.bvh"),
    *("motion new nope.bvh", "motion discover nope.bvh --licence own", "run nope.toml", "status nope.toml"),
    *("bench load --dataset nope", "deploy nope --network lo"),
)
"""Commands whose first argument is not there."""

SLOW = "{'torch', 'newton', 'warp', 'rerun'}"
"""What takes seconds to import."""


def test_what_is_not_there_is_named_before_anything_slow_is_imported(tmp_path):
    code = (
        "import sys; from kine2go_warp.cli.main import main\n"
        f"for line in {NOTHING_THERE!r}:\n"
        "    status = main(line.split())\n"
        f"    print(line, status, *({SLOW} & sys.modules.keys()), file=sys.stderr)\n"
    )
    result = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    lines = result.stderr.splitlines()
    assert [line for line in lines if not line.startswith("kine2go: error: ")] == [f"{one} 2" for one in NOTHING_THERE]
    assert len(lines) == 2 * len(NOTHING_THERE)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", ["dataset score", "dataset render --out a.mp4", "motion cycles", "status"])
def test_a_link_to_itself_is_one_line(command, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "loop").symlink_to("loop")
    name, *more = command.split(" --")
    words = ["dog_trot", "0", *f"--{more[0]}".split()] if more else []
    assert main([*name.split(), "loop", *words]) == 2
    assert capsys.readouterr().err.count("\n") == 1


EVIL = "own\x1b]0;title\x07\x1b[31m\u202e [red]x[/y]"


@pytest.fixture
def evil_dataset(clean_dataset, tmp_path):
    """A dataset whose texts would drive a terminal, in a folder with such a name."""
    path = shutil.copytree(clean_dataset, tmp_path / "[b]\x1b[31m" / "[/x].zarr")
    for file in (path / "zarr.json", path / "dog_trot" / "zarr.json"):
        content = json.loads(file.read_text())
        texts = {name: value for name, value in content["attributes"].items() if isinstance(value, str)}
        kept = {"format_version", "robot", "kind", "motion", "engine"}
        content["attributes"] |= {name: EVIL for name in texts if name not in kept}
        file.write_text(json.dumps(content))
    return path


@pytest.mark.parametrize(
    "command",
    [
        "check",
        "score",
        "quality",
        "review --list",
        "review --reject dog_trot --why \x1b[31m",
        "export --format npz",
        "publish --no-pictures --to published",
        "report --no-pictures",
    ],
)
def test_texts_of_a_dataset_drive_no_terminal(command, evil_dataset, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    name, *words = command.split(" ")
    status = main(["dataset", name, str(evil_dataset), *words])
    captured = capfd.readouterr()
    assert status in (0, 1, 2), captured.err
    shown = captured.out + captured.err
    assert "[/x].zarr" in shown
    assert not any(one in shown for one in "\x1b\x07\u202e")


def test_names_of_stages_drive_no_terminal(capsys, monkeypatch):
    from kine2go_warp.cli.progress import Progress, bar

    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    with Progress() as progress:
        progress.stage("[/x]\x07", "eval")
        progress.advanced(1, 2, "[/y]")
    with bar("reading") as advanced:
        advanced(1, 2, "[/z]")
    captured = capsys.readouterr()
    assert "[/x]\\x07 eval" in captured.err
    assert "[/y]" in captured.err
    assert "[/z]" in captured.out
    assert "\x07" not in captured.out + captured.err


def test_an_interruption_while_a_command_is_imported_is_quiet(capsys, monkeypatch):
    def interrupt(_):
        raise KeyboardInterrupt

    monkeypatch.setattr("kine2go_warp.cli.main.imported", interrupt)
    assert main(["doctor"]) == 130
    assert capsys.readouterr().err == ""


def test_an_interruption_before_any_command_is_imported_is_quiet(capsys, monkeypatch):
    class Interrupted:
        def find_spec(self, *_):
            raise KeyboardInterrupt

    monkeypatch.delitem(sys.modules, "kine2go_warp.cli.main")
    monkeypatch.setattr(sys, "meta_path", [Interrupted()])
    with pytest.raises(SystemExit) as end:
        entry_point()
    assert end.value.code == 130
    assert capsys.readouterr().err == ""
