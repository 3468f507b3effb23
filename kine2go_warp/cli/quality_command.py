"""The command that shows how good the rollouts are against the limits of the filter."""

from dataclasses import dataclass
from pathlib import Path

import tyro


@dataclass(frozen=True)
class Quality:
    """Show the quality figures of a dataset's rollouts against the limits that they were filtered by."""

    dataset: tyro.conf.Positional[Path]
    """A dataset made by 'kine2go gather' or 'kine2go run'."""
    motions: tyro.conf.Positional[tuple[str, ...]] = ()
    """Names of motions; by default all."""
    picture: Path | None = None
    """Draw every rollout into this PNG file, too."""

    def run(self) -> int:
        """Print a table a motion."""
        from kine2go_warp.cli.tables import print_distributions
        from kine2go_warp.dataset.reader import motion_names, read_motion
        from kine2go_warp.errors import DatasetError
        from kine2go_warp.scores.distributions import distributions, draw_distributions

        names = list(self.motions) or motion_names(self.dataset)
        if not names:
            raise DatasetError(f"{self.dataset}: holds no motion yet")
        found = {name: distributions(self.dataset, name) for name in names}
        for name, figures in found.items():
            print_distributions(name, figures, read_motion(self.dataset, name).attributes)
        if self.picture is not None:
            self.picture.parent.mkdir(parents=True, exist_ok=True)
            draw_distributions(found, self.picture)
        return 0
