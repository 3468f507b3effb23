"""Exporting a dataset: a folder appears whole or not at all, with one part for each licence."""

import hashlib
import json
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path

from kine2go_warp import __version__
from kine2go_warp.dataset.access import Dataset, open_dataset
from kine2go_warp.dataset.location import is_remote, located
from kine2go_warp.dataset.motion import Trajectory
from kine2go_warp.errors import ExportError
from kine2go_warp.exports.card import LICENCE_IDENTIFIERS, dataset_card, overview
from kine2go_warp.exports.journal import resumable
from kine2go_warp.exports.target import Output, Target

FORMATS = {
    "lerobot": "lerobot:LEROBOT",
    "minari": "hdf5:MINARI",
    "robomimic": "hdf5:ROBOMIMIC",
    "d4rl": "hdf5:D4RL",
    "motivo": "hdf5:MOTIVO",
    "parquet": "parquet:PARQUET",
    "npz": "npz:NPZ",
    "mjlab": "motions:MJLAB",
    "mimickit": "motions:MIMICKIT",
    "amp": "motions:AMP",
    "humanoidverse": "motions:HUMANOIDVERSE",
    "protomotions": "motions:PROTOMOTIONS",
    "unitree": "motions:UNITREE",
}
"""Where the description of each format is."""

RECORD = "export.json"
"""File by which a folder is known to be an export."""

ProgressCallback = Callable[[int, int], None]


@dataclass(frozen=True)
class ExportRecord:
    """What an export holds; kept in it as ``export.json``."""

    format: str
    dataset: str
    """Name of the dataset's folder."""
    motions: tuple[str, ...]
    trajectories: int
    rows: int
    software_version: str
    parts: dict[str, str]
    """Folder of each licence within the export; ``.`` where there is one licence only."""


def target_named(form: str) -> Target:
    """Return a format by its name.

    Raises:
        ExportError: there is no such format.
    """
    if form not in FORMATS:
        raise ExportError(f"unknown format '{form}'; known are: {', '.join(FORMATS)}")
    module, _, name = FORMATS[form].partition(":")
    return getattr(import_module(f"kine2go_warp.exports.{module}"), name)


def export_dataset(
    path: Path | str,
    form: str,
    out: Path,
    motions: Sequence[str] = (),
    overwrite: bool = False,
    on_trajectory: ProgressCallback | None = None,
    include_rejected: bool = False,
) -> ExportRecord:
    """Export a dataset. After an interruption the same call goes on with the first motion that is not written.

    Motions of different licences go into folders of their own below ``out``, so that no file mixes them.

    Args:
        path: The dataset.
        form: One of ``FORMATS``.
        out: Folder to create.
        motions: Names of motions; by default all.
        overwrite: Replace an older export at ``out``.
        on_trajectory: Called with the trajectories written and their total.
        include_rejected: Also export what a review or, where it is stored, gathering rejected.

    Raises:
        ExportError: the format is unknown, there is nothing to export, or ``out`` exists and may not be replaced.
        DatasetError: there is no such dataset or motion, or it cannot be read.
    """
    target = target_named(form)
    dataset = open_dataset(path, include_rejected)
    if motions:
        dataset = dataset.select(motions)
    check_target(out, overwrite)
    if not dataset.references:
        raise ExportError(f"{path}: holds no trajectories to export")
    if target.check is not None:
        target.check(dataset)
    names = tuple(dict.fromkeys(one.motion for one in dataset.references))
    groups = by_licence(dataset, names)
    folders = {licence: "." if len(groups) == 1 else folder_name(licence) for licence in groups}
    where = dataset.path
    record = ExportRecord(
        form, where.resolve().name, names, len(dataset.references), dataset.num_rows, __version__, folders
    )
    with resumable(out, fingerprint(dataset, record, include_rejected)) as journal:
        count = Counter(len(dataset.references), on_trajectory)
        for licence, members in groups.items():
            part = dataset.select(members)
            folder = journal.data / folders[licence]
            folder.mkdir(exist_ok=True)
            output = Output(part, folder, tuple(target.fields(part.motion(members[0]))))
            write_part(target, output, journal.done, journal.add, count)
            (folder / "README.md").write_text(dataset_card(output, form, target))
        if len(groups) > 1:
            (journal.data / "README.md").write_text(overview(record, groups))
        (journal.data / RECORD).write_text(json.dumps(asdict(record), indent=1))
    return record


class Counter:
    """Counts the trajectories that are written."""

    def __init__(self, total: int, on_trajectory: ProgressCallback | None) -> None:
        self.done, self.total, self._callback = 0, total, on_trajectory

    def add(self, count: int = 1) -> None:
        """Count some more."""
        self.done += count
        if self._callback is not None:
            self._callback(self.done, self.total)

    def counted(self, trajectories: Iterator[Trajectory]) -> Iterator[Trajectory]:
        """Yield trajectories, each counted when the next one is asked for, as it is written then."""
        for one in trajectories:
            yield one
            self.add()


def write_part(
    target: Target, output: Output, done: Sequence[str], on_motion: Callable[[str], None], count: Counter
) -> None:
    """Write the motions of one licence that are not written yet."""
    already = frozenset(done)
    for name in output.motions:
        references = [one for one in output.dataset.references if one.motion == name]
        if name in already:
            count.add(len(references))
            continue
        target.write(output, name, count.counted(output.dataset.trajectories([name], output.arrays)))
        on_motion(name)
    if target.finish is not None:
        target.finish(output)


def by_licence(dataset: Dataset, motions: Sequence[str]) -> dict[str, list[str]]:
    """Return the motions of each licence."""
    groups: dict[str, list[str]] = {}
    for name in motions:
        licence = str(dataset.motion(name).attributes.get("licence") or "unknown")
        groups.setdefault(licence, []).append(name)
    return groups


def folder_name(licence: str) -> str:
    """Return a licence as the name of a folder."""
    return LICENCE_IDENTIFIERS.get(licence) or re.sub(r"[^a-z0-9.]+", "-", licence.lower()).strip("-.") or "unknown"


def fingerprint(dataset: Dataset, record: ExportRecord, include_rejected: bool) -> str:
    """Return a hash of what is exported how, to tell whether an interrupted export can go on."""
    digest = hashlib.sha256(f"{json.dumps(asdict(record))} {include_rejected}".encode())
    for one in dataset.references:
        digest.update(f"{one.motion} {one.index} {one.length} ".encode())
    for name in record.motions:
        metadata = dataset.path / name / "zarr.json"
        digest.update(metadata.read_bytes())
        if not is_remote(dataset.path):
            digest.update(str(metadata.stat().st_mtime_ns).encode())
    return digest.hexdigest()


def default_folder(path: Path, form: str) -> Path:
    """Return the default folder of an export: beside a local dataset, in the current folder for a remote one."""
    if is_remote(located(path)):
        return Path(f"{path.stem}-{form}")
    whole = path if path.name else path.absolute()
    return whole.with_name(f"{whole.stem}-{form}")


def check_target(out: Path, overwrite: bool) -> None:
    """Check that an export may be written to a folder.

    Raises:
        ExportError: something lies there, and it is no export or may not be replaced; or the path has no name.
    """
    if out.name in {"", ".."}:
        raise ExportError(f"{out}: an export is a folder of its own; give it a name with --out")
    if not out.exists() or (out.is_dir() and not any(out.iterdir())):
        return
    if not (out / RECORD).is_file():
        raise ExportError(f"{out}: exists and is no export; choose another folder with --out")
    if not overwrite:
        raise ExportError(f"{out}: holds an export already; replace it with --overwrite, or choose another with --out")
