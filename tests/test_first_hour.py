"""The commands of the docs: all can be read, and those of the first hour run and answer as the page says."""

import re
import shlex
import shutil
import subprocess
import sys

import pytest

from kine2go_warp.cli.main import COMMANDS, find_command, parse
from kine2go_warp.motions.catalogue import motion_named
from tests.conftest import REPOSITORY

PAGES = [REPOSITORY / "README.md", *sorted((REPOSITORY / "docs").glob("*.md"))]
PROGRAM = [sys.executable, "-c", "from kine2go_warp.cli.main import entry_point; entry_point()"]
FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
VARIABLE = re.compile(r"(?:\w+=\S+ )*(?:pip install uv && )?(?:uv run )?kine2go (.*)")


def commands(text: str) -> list[str]:
    """The commands in the code blocks of a page, without what the shell does with them."""
    found = []
    for language, block in FENCE.findall(text):
        if language in ("", "sh", "bash", "console"):
            for line in re.sub(r"\\\n\s*", "", block).splitlines():
                match = VARIABLE.fullmatch(line.removeprefix("$ ").partition("  #")[0].rstrip())
                if match:
                    found.append(
                        match.group(1).partition(" | ")[0].partition(" && ")[0].partition(" > ")[0].removesuffix(" &")
                    )
    return found


def without_refused(text: str) -> str:
    """A page without the commands that it shows to be refused; ``docs/make.py --check`` runs them."""
    return re.sub(r"^\$ kine2go .*\nkine2go: error: .*\n", "", text, flags=re.MULTILINE)


def without_numbers(text: str) -> str:
    """A line of output in which only the words are compared."""
    return re.sub(r"\d[\d,.]*", "#", text)


def agrees(expected: list[str], shown: list[str]) -> bool:
    """Whether output is what a page says, where ``...`` stands for any lines."""
    if not expected:
        return not shown
    if expected[0] == "...":
        return any(agrees(expected[1:], shown[number:]) for number in range(len(shown) + 1))
    return bool(shown) and without_numbers(expected[0]) == without_numbers(shown[0]) and agrees(expected[1:], shown[1:])


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_every_command_of_the_docs_can_be_read(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for line in commands(without_refused(page.read_text())):
        words = shlex.split(line)
        if words[0].startswith("-") or "--preset" in words or "--config" in words:
            continue
        name, rest = find_command(words)
        assert name in COMMANDS
        if "--help" not in rest:
            parse(name, rest)


def test_there_are_many_of_them():
    assert sum(len(commands(page.read_text())) for page in PAGES) > 60


def test_the_comparison_minds_words_and_not_numbers():
    assert agrees(["a", "...", "b 3.1 m"], ["a", "x", "y", "b 2,000.7 m"])
    assert not agrees(["a", "...", "b"], ["a", "x"])
    assert not agrees(["a 3 m"], ["a 3 s"])


@pytest.mark.slow
def test_the_first_hour_runs_as_written(tmp_path):
    (tmp_path / "my").mkdir()
    shutil.copyfile(motion_named("dog_trot").path(None), tmp_path / "my" / "my_dog.txt")
    blocks = FENCE.findall((REPOSITORY / "docs" / "first-hour.md").read_text())
    settings = [block for language, block in blocks if language == "toml"]
    for name, block in zip(("my_motions.toml", "my_recipe.toml"), settings, strict=True):
        (tmp_path / name).write_text(block)
    for language, block in blocks:
        if language == "python":
            subprocess.run([sys.executable, "-c", block], cwd=tmp_path, check=True)
        if not block.startswith("$ kine2go"):
            continue
        command, *expected = block.splitlines()
        run = [*PROGRAM, *shlex.split(command)[2:]]
        result = subprocess.run(
            run, cwd=tmp_path, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
        )
        assert result.returncode == 0, result.stderr
        assert agrees(expected, result.stdout.splitlines()), f"{command}\n{result.stdout}"
