"""The command that shows a dataset on one page."""

from dataclasses import dataclass
from pathlib import Path

from kine2go_warp.cli.data import DatasetPath, MotionNames
from kine2go_warp.cli.texts import say


@dataclass(frozen=True)
class Report:
    """Show a dataset on one HTML page that needs no network: scores, plots, pictures, settings, licences.

    Example: kine2go dataset report runs/demo/dataset.zarr --out report.html
    """

    dataset: DatasetPath
    """A dataset made by 'kine2go dataset gather' or 'kine2go run'."""
    motions: MotionNames = ()
    """Names of its motions; by default all of them."""
    out: Path | None = None
    """File to write (.html); by default beside the dataset, named after it."""
    pictures: bool = True
    """Draw the best, median and worst trajectory of each motion."""
    overwrite: bool = False
    """Replace a file that is there already."""

    def run(self) -> int:
        """Write the page with a progress bar and say where it is."""
        from kine2go_warp.cli.progress import bar
        from kine2go_warp.reports.report import default_path, write_report
        from kine2go_warp.tables import counted

        path = self.out or default_path(self.dataset)
        with bar("reporting") as advanced:
            parts = write_report(self.dataset, path, self.motions, self.pictures, self.overwrite, advanced)
        trajectories = counted(sum(part.trajectories for part in parts), "trajectory")
        say(
            f"{path}: {trajectories} of {counted(len(parts), 'motion')}, {path.stat().st_size / 1e6:.2f} MB; "
            "open it in a browser"
        )
        if self.pictures:
            for note in dict.fromkeys(part.note for part in parts if part.note):
                say(note)
        return 0
