"""Options: what help says of them, and one line for each that is wrong."""

import shlex
import subprocess

import pytest

from kine2go_warp.cli.main import COMMANDS, find_command, imported, main, parse, report
from kine2go_warp.cli.options import condensed
from kine2go_warp.cli.tables import print_table
from kine2go_warp.cli.texts import printable, say
from kine2go_warp.tables import make_table

WRONG = {
    "dataset score a.zarr --ovewrite": "unrecognized options: --ovewrite; did you mean --overwrite?",
    "policy train a.npz --iterations abc": "--iterations: 'abc' is no whole number",
    "policy train a.npz --ppo.gamma nan": "--ppo.gamma: 'nan' is not finite",
    "policy train a.npz --ppo.gama 3": "did you mean --ppo.gamma?",
    "policy train a.npz --iterations": "missing value for argument '--iterations'",
    "policy train a.npz --env.motor.stiffness x": "--env.motor.stiffness: 'x' is no number",
    "motion retarget --time-scale foo": "--time-scale: 'foo' is none of FLOAT|{froude}",
    "dataset replay": "missing: DATASET",
    "motion sources lisst": "invalid choice 'lisst'",
    "demo extra": "unrecognized options: extra",
}


@pytest.mark.parametrize("arguments", WRONG)
@pytest.mark.parametrize("columns", ["40", "80", "200"])
def test_a_wrong_option_is_one_line_at_any_width(arguments, columns, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", columns)
    assert main(arguments.split()) == 2  # pytest's output knows ASCII alone, of which tyro makes its boxes then
    (line,) = capsys.readouterr().err.splitlines()
    assert WRONG[arguments] in line
    assert line.endswith("--help' explains the options")


def help_of(command, capsys) -> str:
    with pytest.raises(SystemExit) as end:
        main([*command.split(), "--help"])
    assert end.value.code == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("command", COMMANDS)
def test_help_has_an_example_that_can_be_read_and_no_default_that_says_nothing(command, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    shown = help_of(command, capsys)
    assert "{None}" not in shown
    if command not in ("policy train", "dataset gather"):  # whose terms have empty parameters
        assert "(default: )" not in shown
    (example,) = [line.partition("Example: ")[2] for line in shown.splitlines() if "Example: " in line]
    _, *words = shlex.split(example)
    name, rest = find_command(words)
    assert name == command
    assert isinstance(parse(name, rest), imported(command))


def test_names_of_files_are_said_in_help(capsys):
    assert "DATASET|CLIP [MOTION ...]" in help_of("dataset review", capsys)
    assert "CLIP [CLIP ...]" in help_of("policy train", capsys)
    assert "RECIPE" in help_of("run", capsys)
    assert "--format {lerobot,minari,robomimic,d4rl,motivo,parquet,npz,mjlab," in help_of("dataset export", capsys)


def test_boxes_of_lines_are_read_as_those_of_ascii():
    lines = (
        "╭─ Required options ─╮",
        "│ Missing from x: │",
        "│     DATASET │",
        "│         A dataset. │",
        "│ ─── │",
        "╰──╯",
    )
    box = "\n".join(lines)
    assert condensed(box) == "missing: DATASET"


def test_a_box_of_an_unknown_form_is_still_one_line():
    assert "\n" not in condensed("╭─ New ─╮\n│ something │\n│ else │\n╰───────╯\n")
    assert condensed("") == "these arguments cannot be read"


EVIL = "a\x1b[31mb\x07\u202ec\x9b1m"


def test_control_characters_of_any_text_reach_no_terminal(capsys):
    report(EVIL)
    say(EVIL)
    print_table(make_table(EVIL, (EVIL, "n"), [(EVIL, "1")], (EVIL,)))
    captured = capsys.readouterr()
    for shown in (captured.out, captured.err):
        assert "\\x1b[31m" in shown
        assert not any(one in shown for one in "\x1b\x07\u202e\x9b")
    assert printable("words\tand\nlines: äöü 犬") == "words\tand\nlines: äöü 犬"


def test_commands_in_messages_work_after_uv_run(capsys, monkeypatch):
    monkeypatch.delenv("UV_RUN_RECURSION_DEPTH", raising=False)
    report("make one with 'kine2go policy train'")
    monkeypatch.setenv("UV_RUN_RECURSION_DEPTH", "1")
    report("make one with 'kine2go policy train'")
    assert main([]) == 0
    captured = capsys.readouterr()
    plain, run = captured.err.splitlines()
    assert plain.endswith("'kine2go policy train'")
    assert run.endswith("'uv run kine2go policy train'")
    assert "uv run kine2go demo" in captured.out


def test_the_shell_completes_commands_options_and_names_of_motions(capsys, tmp_path):
    with pytest.raises(SystemExit):
        main(["--tyro-print-completion", "bash"])
    script = tmp_path / "completion.sh"
    script.write_text(capsys.readouterr().out)

    def completed(*words):
        asked = f"source {script}; COMP_WORDS=({' '.join(words)}); COMP_CWORD={len(words) - 1}; _tyro_kine2go"
        command = ["bash", "-c", f'{asked}; echo "${{COMPREPLY[@]}}"']
        return subprocess.check_output(command, text=True).split()

    assert completed("kine2go", "dataset", "gat") == ["gather"]
    assert "--trajectories" in completed("kine2go", "run", "demo", "--traj")
    assert completed("kine2go", "run", "demo", "--motions", "ai4_dog_can") == ["ai4_dog_canter"]
