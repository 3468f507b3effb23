"""The commands that prepare motions: sources, cycles, retarget, bench."""

import os
import sys
from collections.abc import Container
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from kine2go_warp.cli.data import CatalogueFile, DataFolder, MotionNames, Robot, data_folder, rate_in_hz
from kine2go_warp.cli.texts import say
from kine2go_warp.errors import CatalogueError, Kine2GoError
from kine2go_warp.motions.config import CYCLE_TIMES, LEAST_WAY, RetargetConfig
from kine2go_warp.robots import DEFAULT_ROBOT
from kine2go_warp.tables import counted

if TYPE_CHECKING:
    from kine2go_warp.motions.catalogue_entry import CatalogueEntry
    from kine2go_warp.motions.keypoints import FrameRange

Positional = tyro.conf.Positional


@dataclass(frozen=True)
class OwnFileOptions:
    """Options for motion files that are not in a catalogue."""

    source: str = ""
    """Which source reads a file of your own: one of the package or of --catalogue, or FILE.py:NAME; by default the one
    that recognises it."""
    frames: str = ""
    """Range of a file of your own, as in 120:180; by default all of it."""
    name: str = ""
    """Name of the motion in a file of your own; by default that of the file."""
    rate: float | None = None
    """Frames per second of a file that cannot tell its own [Hz]."""
    licence: str = ""
    """Licence of a file of your own; it goes with the data that are made of it."""
    citation: str = ""
    """Whom to name for a file of your own."""
    once: bool = False
    """The motion in a file of your own is played once, between poses that are held, instead of being repeated."""

    def entry(self, path: Path, own: Path | None) -> "CatalogueEntry":
        """Return what a catalogue would say about a file."""
        from kine2go_warp.motions.own_file import OwnFile

        licence = licence_for(path, self.licence)
        return OwnFile(
            path,
            licence,
            self.name,
            self.source,
            parsed_range(self.frames),
            rate_in_hz(self.rate),
            self.citation,
            "once" if self.once else "cycle",
        ).entry(own)


def licence_for(path: Path, given: str) -> str:
    """Return the licence of a file: the one given, else the answer at the terminal, empty where there is none."""
    return given or (ask(f"Under which licence may {path.name} be used? ") if sys.stdin.isatty() else "")


def parsed_range(text: str) -> "FrameRange":
    """Return a range such as ``120:180``; either end may be left out.

    Raises:
        Kine2GoError: it is none.
    """
    from kine2go_warp.motions.keypoints import FrameRange

    start, colon, end = text.partition(":")
    if text and not (colon and all(part == "" or part.isdigit() for part in (start, end))):
        raise Kine2GoError(f"--frames {text}: expected START:END, as in 120:180")
    return FrameRange(int(start or 0), int(end or -1))


def is_file(name: str, known: Container[str]) -> bool:
    """Return whether a text names a file rather than a motion of the catalogue."""
    return name not in known and (os.sep in name or "." in name or Path(name).is_file())


def chosen_entries(names: tuple[str, ...], every: bool, own: Path | None) -> "list[CatalogueEntry]":
    """Return the catalogue entries that are named, or all of them.

    Raises:
        CatalogueError: none is named, or one is not in the catalogue.
    """
    from kine2go_warp.motions.catalogue import load_catalogue, motion_named

    if every:
        return list(load_catalogue(own).values())
    if not names:
        raise CatalogueError("name at least one motion, or --all; 'kine2go motion sources list' shows them")
    return [motion_named(name, own) for name in names]


@dataclass(frozen=True)
class Retarget:
    """Retarget motions to a robot, save them as clips and report on their quality.

    Example: kine2go motion retarget dog_trot --out runs/clips
    """

    motions: MotionNames
    """Names of catalogue entries, such as dog_trot, or motion files of your own, such as ./walk.bvh."""
    all: bool = False
    """Every motion of --catalogue, or else of the package's catalogue, whose file is there."""
    robot: Robot = DEFAULT_ROBOT
    data: DataFolder = None
    catalogue: CatalogueFile = None
    mirror: bool = False
    """Also the mirror image of each motion, as NAME_mirrored."""
    out: Path = Path("runs/clips")
    """Folder for the clips and their report.json."""
    sheets: bool = False
    """Draw a picture of each clip beside it."""
    markdown: Path | None = None
    """Write the table of metrics to this file, too."""
    own: tyro.conf.OmitArgPrefixes[OwnFileOptions] = field(default_factory=OwnFileOptions)
    config: tyro.conf.OmitArgPrefixes[RetargetConfig] = field(default_factory=RetargetConfig)

    def run(self) -> int:
        """Retarget, save and print a table."""
        from kine2go_warp.cli.progress import tracked
        from kine2go_warp.cli.tables import print_clips
        from kine2go_warp.files import atomic_file
        from kine2go_warp.motions.inverse_kinematics import InverseKinematics
        from kine2go_warp.motions.quality import assess, clip_remarks
        from kine2go_warp.motions.report import draw_sheet, markdown_table, write_json
        from kine2go_warp.motions.retarget import retarget
        from kine2go_warp.robots import robot_named

        spec = robot_named(self.robot)
        folder = data_folder(self.data)
        entries = [twin for entry in self.entries() for twin in ([entry, entry.twin()] if self.mirror else [entry])]
        if twice := next((entry.name for entry in entries if sum(entry.name == one.name for one in entries) > 1), None):
            raise Kine2GoError(f"two motions would be named '{twice}'; leave one out, or give a file another --name")
        missing = [entry for entry in entries if self.all and not entry.is_there(folder)]
        solver = InverseKinematics(spec)
        present = [entry for entry in entries if entry not in missing]
        qualities, failures = [], []
        for entry in tracked(present, "retargeting"):
            try:
                result = retarget(entry, folder, solver, self.config)
            except Kine2GoError as error:
                failures.append(f"{entry.name}: {error}")
                continue
            result.clip.save(self.out / f"{entry.name}.npz")
            if self.sheets:
                draw_sheet(result.clip, spec, self.out / f"{entry.name}.png")
            qualities.append(assess(result, spec))
        if not qualities and failures:
            raise Kine2GoError("; ".join(failures))
        remarks = {quality.name: clip_remarks(quality) for quality in qualities}
        write_json(qualities, remarks, self.out / "report.json")
        if self.markdown is not None:
            with atomic_file(self.markdown) as temporary:
                temporary.write_text(markdown_table(qualities, remarks))
        print_clips(qualities, remarks, self.out)
        if missing:
            files = sorted({f"{entry.name} ({entry.file})" for entry in missing})
            say(f"not there: {', '.join(files)}")
        for failure in failures:
            say(f"kine2go: error: {failure}", error=True)
        return 2 if failures else 0

    def entries(self) -> "list[CatalogueEntry]":
        """Return what is to be retargeted.

        Raises:
            Kine2GoError: a motion or a file is not there, or an option is for one file but there are several.
        """
        from kine2go_warp.motions.catalogue import load_catalogue, motion_named, own_catalogue

        known = load_catalogue(self.catalogue)
        files = [name for name in self.motions if is_file(name, known)]
        if len(files) != 1 and (self.own.frames or self.own.name):
            raise Kine2GoError("--frames and --name are for one file of your own")
        if self.all and self.catalogue is not None:
            return list(own_catalogue(self.catalogue).values())
        if self.all or not files:
            return chosen_entries(self.motions, self.all, self.catalogue)
        return [
            self.own.entry(Path(name), self.catalogue) if name in files else motion_named(name, self.catalogue)
            for name in self.motions
        ]


@dataclass(frozen=True)
class Cycles:
    """Find where a motion file repeats itself: the best ranges for a cycle.

    Example: kine2go motion cycles my_dog.txt --longest 2
    """

    file: Annotated[Positional[Path], tyro.conf.arg(metavar="FILE")]
    """A motion file (for Solo8: file.pt:K)."""
    source: str = ""
    """Which source reads the file: one of the package or of --catalogue, or FILE.py:NAME; by default the one that
    recognises it."""
    catalogue: CatalogueFile = None
    rate: float | None = None
    """Frames per second of a file that cannot tell its own [Hz]; 60 by default."""
    shortest: float = CYCLE_TIMES[0]
    """Shortest cycle [s]."""
    longest: float = CYCLE_TIMES[1]
    """Longest cycle [s]."""
    travel: float = LEAST_WAY
    """Least way that the robot must go in a cycle [m], to leave out standing still."""
    count: int = 10
    """How many to list."""
    robot: str = DEFAULT_ROBOT
    """The robot that must go so far: its name, or FILE.py:NAME for one of your own."""

    def run(self) -> int:
        """Search and print a table."""
        from kine2go_warp.cli.tables import print_cycles
        from kine2go_warp.motions.cycle_search import cycle_frames, find_cycles
        from kine2go_warp.motions.own_file import OwnFile
        from kine2go_warp.motions.targets import pose_targets
        from kine2go_warp.robots import robot_named

        if not 0.0 < self.shortest <= self.longest or self.count < 1:
            raise Kine2GoError("choose 0 < shortest <= longest and a count of at least 1")
        source = OwnFile(self.file, "", source=self.source, rate=rate_in_hz(self.rate)).reader(self.catalogue)
        motion = source.load(self.file, self.rate)
        if self.rate is not None and abs(motion.rate / self.rate - 1.0) > 0.01:
            raise Kine2GoError(f"{self.file}: tells that it runs at {motion.rate:.1f} Hz; leave --rate out")
        for remark in motion.remarks:
            say(f"{self.file}: {remark}", error=True)
        targets = pose_targets(motion, source, robot_named(self.robot))
        frames = cycle_frames(motion.rate, (self.shortest, self.longest))
        found = find_cycles(targets, *frames, self.count, self.travel)
        if not found:
            raise Kine2GoError(f"{self.file}: no range of {self.shortest} to {self.longest} s repeats itself")
        print_cycles(found, motion.rate, targets, self.file)
        return 0


@dataclass(frozen=True)
class Sources:
    """List the catalogue's motions, check their files, or fetch them.

    Example: kine2go motion sources check --data clips
    """

    action: Positional[Literal["list", "check", "fetch"]]
    """list: what there is. check: whether each file is there and whole. fetch: download what is missing."""
    motions: MotionNames = ()
    """Names of catalogue entries; by default all."""
    data: DataFolder = None
    catalogue: CatalogueFile = None
    url: str | None = None
    """Address below which the files lie as in the data folder; needed to fetch."""
    yes: bool = False
    """Agree to the licences without being asked."""

    def run(self) -> int:
        """List, check or fetch."""
        from kine2go_warp.cli.tables import print_file_states, print_motions

        entries = chosen_entries(self.motions, not self.motions, self.catalogue)
        if self.action == "list":
            print_motions(entries, data_folder(self.data))
            return 0
        if self.action == "fetch":
            self._fetch(entries)
        from kine2go_warp.motions.fetch import check_file

        folder = data_folder(self.data)
        states = [check_file(entry, folder) for entry in entries]
        print_file_states(entries, states)
        lacking = sum(state.state in ("missing", "damaged") for state in states)
        if lacking:
            more = "" if folder else "; name the folder of source clips with --data or in KINE2GO_DATA"
            raise CatalogueError(f"{lacking} of {counted(len(states), 'file')} missing or damaged{more}")
        return 0

    def _fetch(self, entries: "list[CatalogueEntry]") -> None:
        """Print the licences, ask, and download what is missing."""
        from rich.progress import DownloadColumn, Progress, TextColumn, TransferSpeedColumn

        from kine2go_warp.cli.tables import console
        from kine2go_warp.motions.fetch import check_file, fetch_file

        if self.url is None or self.data is None:
            raise CatalogueError("fetch needs --url (where the files are) and --data (the folder to put them in)")
        if not self.url.startswith(("http://", "https://")):
            raise CatalogueError(f"{self.url}: not an address that begins with http:// or https://")
        self.data.mkdir(parents=True, exist_ok=True)
        wanted = {}
        for entry in (one for listed in entries for one in listed.with_files()):
            if check_file(entry, self.data).state in ("missing", "damaged"):
                wanted.setdefault(entry.motion_source.data_file(Path(entry.file)), entry)
        output = console()
        for licence, citation in sorted({(entry.licence, entry.citation) for entry in wanted.values()}):
            say(f"{licence}: {citation}")
        if wanted and not self.yes and not accepted_by_user():
            raise CatalogueError("nothing fetched, since the licences were not accepted")
        columns = (TextColumn("{task.description}", markup=False), DownloadColumn(), TransferSpeedColumn())
        with Progress(*columns, console=output, disable=not output.is_terminal) as progress:
            for file, entry in wanted.items():
                task = progress.add_task(str(file), total=None)
                fetch_file(
                    entry,
                    self.url,
                    self.data,
                    lambda done, total, task=task: progress.update(task, completed=done, total=total or None),
                )


def accepted_by_user() -> bool:
    """Ask whether the licences are accepted. Without anybody to answer they are not."""
    return ask("Do you accept these licences? [y/N] ").lower() == "y"


def ask(question: str) -> str:
    """Return the answer to a question; an empty text where standard input is closed."""
    try:
        return input(question).strip()
    except EOFError:
        return ""
