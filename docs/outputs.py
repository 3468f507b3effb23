"""What pages show of commands that take seconds: they are run, and the page gets what they print.

A fenced block after ``<!-- docs/make.py: output -->`` is such a block: lines that begin with ``$ kine2go`` are
commands, run in one folder for all blocks of a page; what stands between them is their output, errors included.
"""

import contextlib
import io
import os
import re
import shlex
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from kine2go_warp.cli.main import main
from kine2go_warp.motions.catalogue import motion_named

REPOSITORY = Path(__file__).resolve().parent.parent
MARKED = re.compile(r"(<!-- docs/make.py: output -->\n```\w*\n)(.*?)(^```$)", re.DOTALL | re.MULTILINE)
TOML = re.compile(r"^```toml\n(.*?)^```$", re.DOTALL | re.MULTILINE)
OURS = ("KINE2GO_DATA", "UV_RUN_RECURSION_DEPTH", "COLUMNS")
"""Variables of the environment that change what commands print."""
HOME = "/home/you"
"""Stands for the folder that the commands are run in."""


def with_outputs(text: str) -> str:
    """Return a page with what its marked commands print now."""
    if not MARKED.search(text):
        return text
    with scratch_folder(text):
        return MARKED.sub(lambda found: found[1] + answered(found[2]) + found[3], text)


def answered(block: str) -> str:
    """Return the commands of a block, each with what it prints."""
    commands = [line for line in block.splitlines() if line.startswith("$ kine2go")]
    return "".join(f"{line}\n{output_of(shlex.split(line)[2:])}" for line in commands)


def output_of(arguments: list[str]) -> str:
    """Run a command in this process and return all that it prints, without spaces at the ends of lines."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        main(arguments)
    lines = printed.getvalue().replace(str(Path.cwd()), HOME).splitlines()
    return "".join(f"{line.rstrip()}\n" for line in lines)


@contextlib.contextmanager
def scratch_folder(page: str) -> Iterator[None]:
    """Work in a folder with what commands of pages read: a motion file, the page's own TOML, a made-up dataset."""
    before, kept = Path.cwd(), {name: os.environ.pop(name) for name in OURS if name in os.environ}
    with tempfile.TemporaryDirectory() as name:
        os.chdir(name)
        try:
            Path("my").mkdir()
            shutil.copyfile(motion_named("dog_trot").path(None), "my/my_dog.txt")
            for path, text in zip(("my_motions.toml", "my_recipe.toml"), TOML.findall(page), strict=False):
                Path(path).write_text(text)
            if "walks.zarr" in page:
                write_walks(Path("walks.zarr"))
            yield
        finally:
            os.chdir(before)
            os.environ.update(kept)


def write_walks(path: Path) -> None:
    """Write the made-up dataset of the tests."""
    sys.path.insert(0, str(REPOSITORY))
    try:
        from tests import walks

        walks.write_walks(path)
    finally:
        sys.path.remove(str(REPOSITORY))
