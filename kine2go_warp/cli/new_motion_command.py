"""The command that introduces a motion file of one's own."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from kine2go_warp.cli.data import CatalogueFile, Robot, rate_in_hz
from kine2go_warp.cli.texts import command_prefix, say
from kine2go_warp.errors import CatalogueError
from kine2go_warp.robots import DEFAULT_ROBOT


@dataclass(frozen=True)
class NewMotion:
    """Look at a motion file: say what it is taken for, draw it, and write a table to edit.

    Example: kine2go motion new walk.bvh
    """

    file: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FILE")]
    """A motion file, such as walk.bvh."""
    source: str = ""
    """Which source reads it: one of the package or of --catalogue, or FILE.py:NAME; by default the one that recognises
    it."""
    rate: float | None = None
    """Frames per second of a file that cannot tell its own [Hz]."""
    robot: Robot = DEFAULT_ROBOT
    catalogue: CatalogueFile = None
    out: Path | None = None
    """The table; by default NAME.toml beside the file."""

    def run(self) -> int:
        """Look, say, draw and write."""
        from kine2go_warp.cli.tables import make_table, print_table
        from kine2go_warp.files import atomic_file
        from kine2go_warp.motions.own_file import OwnFile, introduce, name_of
        from kine2go_warp.motions.report import draw_motion
        from kine2go_warp.robots import robot_named

        rate = rate_in_hz(self.rate)
        name = name_of(self.file)
        table = self.out or self.file.with_name(f"{name}.toml")
        if table.exists():
            raise CatalogueError(f"{table}: is there already; name another file with --out, or remove it")
        file = OwnFile(self.file, "", source=self.source, rate=rate)
        found = introduce(file, robot_named(self.robot), self.catalogue)
        print_table(make_table(str(self.file), ("what", "taken for"), found.lines(), ("what", "taken for")))
        picture = table.with_suffix(".png")
        draw_motion(found.motion, f"{self.file.name}, read as {found.source.name}", picture)
        with atomic_file(table) as temporary:
            temporary.write_text(found.toml(name))
        command = f"{command_prefix()}kine2go motion retarget {name} --catalogue {table}"
        say(f"look at {picture}, edit {table}, and then: {command}")
        return 0
