"""The command that finds the motions in long recordings."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from kine2go_warp.cli.data import CatalogueFile, Robot, rate_in_hz
from kine2go_warp.cli.texts import command_prefix, say
from kine2go_warp.errors import CatalogueError
from kine2go_warp.robots import DEFAULT_ROBOT

if TYPE_CHECKING:
    from kine2go_warp.motions.discovery.discover import Discovery


@dataclass(frozen=True)
class Discover:
    """Find the motions in long recordings: cut them, label them, and write a catalogue with a contact sheet.

    Example: kine2go motion discover recordings/*.bvh --licence 'CC BY 4.0' --out my_motions.toml
    """

    files: Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="FILE [FILE ...]")]
    """Motion files, such as long.bvh."""
    out: Path = Path("my_motions.toml")
    """The catalogue; the contact sheet lies beside it as .html."""
    licence: str = ""
    """Under which the files may be used; it goes with the data that are made of them."""
    citation: str = ""
    """Whom to name for them."""
    source: str = ""
    """Which source reads them: one of the package or of --catalogue, or FILE.py:NAME; by default the one that
    recognises each."""
    rate: float | None = None
    """Frames per second of files that cannot tell their own [Hz]."""
    mirrored: bool = False
    """Give each motion a twin with left and right exchanged, as NAME_mirrored."""
    check: bool = True
    """Retarget each motion and leave out those whose clip has a fault."""
    robot: Robot = DEFAULT_ROBOT
    catalogue: CatalogueFile = None
    overwrite: bool = False
    """Replace a catalogue that is there."""

    def run(self) -> int:
        """Search, write and print what was found."""
        from kine2go_warp.cli.motion_commands import licence_for
        from kine2go_warp.cli.progress import bar
        from kine2go_warp.files import atomic_file
        from kine2go_warp.motions.discovery.discover import discover
        from kine2go_warp.motions.discovery.sheet import contact_sheet
        from kine2go_warp.motions.discovery.tables import catalogue_text
        from kine2go_warp.motions.inverse_kinematics import InverseKinematics
        from kine2go_warp.motions.own_file import OwnFile
        from kine2go_warp.robots import robot_named

        rate, sheet = rate_in_hz(self.rate), self.out.with_suffix(".html")
        if not self.files:
            raise CatalogueError("name at least one motion file")
        for path in (self.out, sheet):
            if path.exists() and not self.overwrite:
                raise CatalogueError(f"{path}: is there already; name another file with --out, or add --overwrite")
        licence = licence_for(self.files[0], self.licence)
        files = [OwnFile(path, licence, source=self.source, rate=rate, citation=self.citation) for path in self.files]
        with bar("discovering") as advanced:
            solver = InverseKinematics(robot_named(self.robot))
            found = discover(files, solver, advanced, self.catalogue, self.check)
        if not found.motions:
            raise CatalogueError(f"no motion was found that fits the robot; {len(found.refused)} do not")
        named = {file.path: file for file in files}
        text = catalogue_text(found, named, self.out, self.mirrored, self.catalogue)
        with atomic_file(sheet) as temporary:
            temporary.write_text(contact_sheet(found))
        with atomic_file(self.out) as temporary:
            temporary.write_text(text)
        print_found(found)
        say(f"look at {sheet}, and then: {command_prefix()}kine2go motion retarget --all --catalogue {self.out}")
        return 0


def print_found(found: "Discovery") -> None:
    """Print how many motions of which label there are, and what was left out."""
    from kine2go_warp.cli.tables import make_table, print_table

    rows = []
    for label in dict.fromkeys(one.cut.label for one in found.motions):
        chosen = [one.cut for one in found.motions if one.cut.label == label]
        speeds = [one.gait.speed for one in chosen]
        rows.append((label, str(len(chosen)), f"{min(speeds):.2f} to {max(speeds):.2f}", chosen[0].name))
    print_table(make_table(f"{len(found.motions)} motions", ("label", "motions", "speed [m/s]", "best"), rows))
    say(
        f"{found.recorded_time / 60.0:.1f} minutes recorded, {found.unique_time / 60.0:.1f} unique; "
        f"{found.duplicates} near duplicates left out, {len(found.refused)} do not fit the robot"
    )
