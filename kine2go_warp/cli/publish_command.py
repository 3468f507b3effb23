"""The command that makes a folder, or a dataset on the Hugging Face Hub, of a dataset that its checks find clean."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from kine2go_warp.cli.data import DatasetPath, MotionNames
from kine2go_warp.cli.export_command import FORMAT_NAMES
from kine2go_warp.cli.texts import say
from kine2go_warp.errors import ExportError

if TYPE_CHECKING:
    from kine2go_warp.dataset.checks.records import Report
    from kine2go_warp.exports.export import ExportRecord

HUB = "hf://datasets/"
CHECKSUMS = "SHA256SUMS"


@dataclass(frozen=True)
class Publish:
    """Check a dataset, and make of it what can be passed on: data, card, scores, pictures, checksums; licences apart.

    Example: kine2go dataset publish runs/demo/dataset.zarr --to runs/published
    """

    dataset: DatasetPath
    """A dataset made by 'kine2go dataset gather' or 'kine2go run'."""
    to: Annotated[str, tyro.conf.arg(metavar="FOLDER|hf://datasets/USER/NAME")]
    """Folder to create, or hf://datasets/USER/NAME: a private dataset on the Hugging Face Hub, one for each licence."""
    motions: MotionNames = ()
    """Names of motions; by default all."""
    format: Annotated[str, tyro.conf.arg(metavar=FORMAT_NAMES)] = "parquet"
    """Format of the data; the Hub shows and streams parquet."""
    pictures: bool = True
    """Draw trajectories for the page."""
    overwrite: bool = False
    """Replace an older one in that folder."""

    def run(self) -> int:
        """Check, write, and say where it is."""
        from kine2go_warp.exports.export import check_target
        from kine2go_warp.files import atomic_folder
        from kine2go_warp.tables import counted

        hub = self.to.removeprefix(HUB) if self.to.startswith(HUB) else ""
        if self.to.startswith("hf:") and hub.count("/") != 1:
            raise ExportError(f"{self.to}: a dataset on the Hub is named {HUB}USER/NAME")
        if not hub:
            check_target(Path(self.to), self.overwrite)
        check_is_clean(self.dataset, self.motions)
        if hub:
            with tempfile.TemporaryDirectory() as temporary:
                record = self._write(Path(temporary) / "published")
                places = upload(Path(temporary) / "published", record, hub)
        else:
            with atomic_folder(Path(self.to)) as folder:
                record = self._write(folder)
            places = [str(Path(self.to) / part) for part in record.parts.values()]
        count = counted(record.trajectories, "trajectory")
        for licence, place in zip(record.parts, places, strict=True):
            say(f"{place}: {licence}")
        say(f"{count} of {counted(len(record.motions), 'motion')}, checked")
        return 0

    def _write(self, folder: Path) -> "ExportRecord":
        """Write everything that belongs to the dataset into an empty folder, or a new one."""
        from kine2go_warp.cli.progress import bar
        from kine2go_warp.dataset import open_dataset
        from kine2go_warp.exports.export import by_licence, export_dataset

        with bar(f"exporting to {self.format}") as advanced:
            record = export_dataset(self.dataset, self.format, folder, self.motions, True, advanced)
        groups = by_licence(open_dataset(self.dataset), record.motions)
        for licence, part in record.parts.items():
            add_scores(self.dataset, groups[licence], folder / part, self.pictures)
        for part in {".", *record.parts.values()}:
            write_checksums(folder / part)
        return record


def check_is_clean(dataset: Path, motions: Sequence[str]) -> None:
    """Check a dataset.

    Raises:
        ExportError: a check found something wrong; the message names the first and how many there are.
        DatasetError: there is no dataset, or it holds no such motion.
    """
    from kine2go_warp.cli.progress import bar
    from kine2go_warp.dataset import open_dataset
    from kine2go_warp.dataset.checked import save_findings
    from kine2go_warp.dataset.checks.run import check_dataset

    robot = open_dataset(dataset).robot
    with bar("checking") as advanced:
        report: Report = check_dataset(
            dataset, robot, tuple(motions), lambda name, number, total: advanced(number - 1, total, name)
        )
    save_findings(dataset, report)
    wrong = [one for one in report.findings if not one.is_remark]
    if wrong:
        where = "/".join(part for part in (wrong[0].motion, wrong[0].array) if part)
        raise ExportError(
            f"{dataset}: not published, {len(wrong)} finding(s) of 'kine2go dataset check', the first is "
            f"{wrong[0].check} in {where or 'the store'}: {wrong[0].what}"
        )


def add_scores(dataset: Path, motions: Sequence[str], folder: Path, pictures: bool) -> None:
    """Add scores as JSON, the page with pictures, and plots of each motion, and name them in the card."""
    from kine2go_warp.cli.progress import tracked
    from kine2go_warp.dataset import open_dataset
    from kine2go_warp.reports.report import write_report
    from kine2go_warp.scores.plots import compute_curves, draw
    from kine2go_warp.scores.report import measure, score, write_json
    from kine2go_warp.tables import make_table, markdown, number_text

    opened, measured, plots = open_dataset(dataset), [], []
    for name in tracked(motions, "scoring"):
        data = opened.load(name)
        measured.append(measure(data, opened.robot))
        plots += draw(compute_curves(data), folder / "plots")
    scores = score(measured)
    write_json(Path(dataset.name), measured, scores, folder / "scores.json")
    write_report(dataset, folder / "report.html", motions, pictures)
    rows = [
        (name, number_text(one.value), f"{number_text(one.low)} to {number_text(one.high)}")
        for name, one in scores.overall.items()
    ]
    table = markdown(make_table("", ("metric", "mean", "95 % interval"), rows))
    shown = "\n".join(f"![{path.stem}](plots/{path.name})" for path in plots)
    with (folder / "README.md").open("a") as card:
        card.write(
            f"\n## Scorecard\n\nOf all motions here; by motion in `scores.json`, with pictures in `report.html`. "
            f"`{CHECKSUMS}` has the checksum of every file.\n\n{table}\n{shown}\n"
        )


def write_checksums(folder: Path) -> None:
    """Write the checksums of all files below a folder as ``sha256sum --check`` reads them."""
    from kine2go_warp.files import sha256_of

    files = sorted(path for path in folder.rglob("*") if path.is_file() and path != folder / CHECKSUMS)
    lines = [f"{sha256_of(path)}  {path.relative_to(folder).as_posix()}\n" for path in files]
    (folder / CHECKSUMS).write_text("".join(lines))


def upload(folder: Path, record: "ExportRecord", name: str) -> list[str]:
    """Upload the part of each licence to a private dataset of its own on the Hub, and return the addresses.

    Raises:
        MissingExtraError: huggingface_hub is not installed.
        ExportError: the Hub refuses it, or cannot be reached.
    """
    from huggingface_hub import HfApi

    places = []
    for part in record.parts.values():
        repository = name if part == "." else f"{name}-{part}"
        try:
            api = HfApi()
            api.create_repo(repository, repo_type="dataset", private=True, exist_ok=True)
            api.upload_folder(repo_id=repository, repo_type="dataset", folder_path=str(folder / part))
        except Exception as error:  # noqa: BLE001 - the Hub's client raises errors of many kinds
            reason = " ".join(str(error).split())[:200]
            raise ExportError(f"{HUB}{repository}: not uploaded ({error.__class__.__name__}: {reason})") from None
        places.append(f"{HUB}{repository}")
    return places
