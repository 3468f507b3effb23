"""Exporting a dataset: the whole folder appears at once, or not at all."""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from kine2go_warp import __version__
from kine2go_warp.dataset.access import Dataset, open_dataset
from kine2go_warp.errors import ExportError
from kine2go_warp.exports.card import dataset_card
from kine2go_warp.exports.fields import Field
from kine2go_warp.files import atomic_folder

FORMATS = ("lerobot", "npz")

RECORD = "export.json"
"""File by which a folder is known to be an export."""


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


def export_dataset(
    path: Path,
    form: str,
    out: Path,
    motions: Sequence[str] = (),
    overwrite: bool = False,
    on_trajectory: Callable[[int, int], None] | None = None,
    include_rejected: bool = False,
) -> ExportRecord:
    """Export a dataset.

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
    if form not in FORMATS:
        raise ExportError(f"unknown format '{form}'; known are: {', '.join(FORMATS)}")
    dataset = open_dataset(path, include_rejected)
    if motions:
        dataset = dataset.select(motions)
    check_target(out, overwrite)
    if not dataset.references:
        raise ExportError(f"{path}: holds no trajectories to export")
    names = tuple(dict.fromkeys(one.motion for one in dataset.references))
    record = ExportRecord(form, path.resolve().name, names, len(dataset.references), dataset.num_rows, __version__)
    with atomic_folder(out) as staging:
        fields = write(dataset, form, staging, on_trajectory)
        (staging / "README.md").write_text(dataset_card(dataset, form, fields, loading(dataset, form)))
        (staging / RECORD).write_text(json.dumps(asdict(record), indent=1))
    return record


def default_folder(path: Path, form: str) -> Path:
    """Return where an export goes if nothing else is said: beside the dataset."""
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


def write(dataset: Dataset, form: str, folder: Path, on_trajectory: Callable[[int, int], None] | None) -> list[Field]:
    """Write the data in one of the formats and return its fields."""
    if form == "npz":
        from kine2go_warp.exports.npz import write_npz

        return write_npz(dataset, folder, on_trajectory)
    from kine2go_warp.exports.lerobot import write_lerobot

    return write_lerobot(dataset, folder, on_trajectory)


def loading(dataset: Dataset, form: str) -> str:
    """Return the lines that load an export."""
    if form == "npz":
        from kine2go_warp.exports import npz

        return npz.LOADING.replace("{motion}", dataset.references[0].motion)
    from kine2go_warp.exports import lerobot

    return lerobot.LOADING.replace("FPS", f"{dataset.rate:.0f}")
