"""The command that shows how good the rollouts are against the limits of the filter."""

from dataclasses import dataclass
from pathlib import Path

from kine2go_warp.cli.data import DatasetPath, MotionNames
from kine2go_warp.cli.texts import say
from kine2go_warp.errors import DatasetError


@dataclass(frozen=True)
class Quality:
    """Show how good a dataset's rollouts are against the limits of the filter, and what states they cover.

    Example: kine2go dataset quality runs/demo/dataset.zarr --picture quality.png
    """

    dataset: DatasetPath
    """A dataset made by 'kine2go dataset gather' or 'kine2go run'."""
    motions: MotionNames = ()
    """Names of motions; by default all."""
    picture: Path | None = None
    """Draw every rollout into this PNG file, too."""

    def run(self) -> int:
        """Print a table for each motion."""
        from kine2go_warp.cli.tables import print_distributions
        from kine2go_warp.dataset import open_dataset
        from kine2go_warp.dataset.checked import check_note
        from kine2go_warp.scores.coverage import measure_coverage
        from kine2go_warp.scores.distributions import distributions, draw_distributions
        from kine2go_warp.scores.report import review_note, scored_motions

        if self.picture is not None and self.picture.suffix.lower() != ".png":
            raise DatasetError(f"{self.picture}: a picture ends in .png, not '{self.picture.suffix}'")
        dataset = open_dataset(self.dataset)
        names = scored_motions(dataset, self.motions)
        found = {name: distributions(self.dataset, name) for name in names}
        for name, metrics in found.items():
            print_distributions(name, metrics, dataset.motion(name).attributes)
            say(f"coverage: {measure_coverage(dataset.load(name))}")
        for note in (review_note(dataset, self.motions), check_note(self.dataset, names)):
            if note:
                say(f"{self.dataset}: {note}")
        if self.picture is not None:
            draw_distributions(found, self.picture)
        return 0
