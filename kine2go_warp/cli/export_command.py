"""The command that exports a dataset."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from kine2go_warp.cli.data import ClipPaths, DatasetPath, MotionNames, read_named_clips
from kine2go_warp.cli.texts import say

MOTION_FORMAT_NAMES = "mjlab,mimickit,amp,humanoidverse,protomotions,unitree"
FORMAT_NAMES = f"{{lerobot,minari,robomimic,d4rl,motivo,parquet,npz,{MOTION_FORMAT_NAMES}}}"


@dataclass(frozen=True)
class Export:
    """Write a dataset in the format of another program, with a dataset card; a folder for each licence.

    Example: kine2go dataset export runs/demo/dataset.zarr --format npz --out runs/npz
    """

    dataset: DatasetPath
    """The dataset (.zarr)."""
    motions: MotionNames = ()
    """Names of motions; by default all."""
    format: Annotated[str, tyro.conf.arg(metavar=FORMAT_NAMES)] = "lerobot"
    """The format; docs/exports.md says which program reads which."""
    out: Path | None = None
    """Folder to create; by default beside the dataset, named after it and the format."""
    include_rejected: bool = False
    """Also export rollouts that gathering rejected, with the reason, and those that a review rejected."""
    overwrite: bool = False
    """Replace an older export in that folder."""

    def run(self) -> int:
        """Export with a progress bar and say what was written."""
        from kine2go_warp.cli.progress import bar
        from kine2go_warp.dataset.checked import check_note
        from kine2go_warp.exports.export import default_folder, export_dataset
        from kine2go_warp.tables import counted

        out = self.out or default_folder(self.dataset, self.format)
        with bar(f"exporting to {self.format}") as advanced:
            record = export_dataset(
                self.dataset, self.format, out, self.motions, self.overwrite, advanced, self.include_rejected
            )
        size = sum(path.stat().st_size for path in out.rglob("*") if path.is_file()) / 1e6
        trajectories, motions = counted(record.trajectories, "trajectory"), counted(len(record.motions), "motion")
        say(
            f"{out}: {trajectories} of {motions}, {record.rows} rows, "
            f"{size:.1f} MB; what is in it and whose it is: {out / 'README.md'}"
        )
        if note := check_note(self.dataset, record.motions):
            say(f"remark: {note}")
        return 0


@dataclass(frozen=True)
class ExportClips:
    """Write clips as motions for other trackers, licences apart.

    Example: kine2go motion export runs/demo/clips/dog_trot.npz --format mjlab --out runs/mjlab
    """

    clips: ClipPaths
    """Clips that 'kine2go motion retarget' made (.npz)."""
    out: Path
    """Folder to create."""
    format: Annotated[str, tyro.conf.arg(metavar=f"{{{MOTION_FORMAT_NAMES}}}")] = "mjlab"
    """The format; docs/exports.md says which program reads which."""
    overwrite: bool = False
    """Replace an older export in that folder."""

    def run(self) -> int:
        """Write the files and say where they are."""
        from kine2go_warp.exports.clips import export_clips
        from kine2go_warp.tables import counted

        clips = read_named_clips(self.clips)
        export_clips(clips, self.format, self.out, self.overwrite)
        say(f"{self.out}: {counted(len(clips), 'clip')} for {self.format}; whose they are: {self.out / 'README.md'}")
        return 0
