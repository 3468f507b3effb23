"""The command that scores a dataset."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from kine2go_warp.cli.data import DatasetPath, MotionNames
from kine2go_warp.cli.texts import say
from kine2go_warp.errors import DatasetError

if TYPE_CHECKING:
    from kine2go_warp.scores.report import DatasetScores

HEADLINES = ("joint_rmse", "root_error", "foot_error", "body_emd", "foot_slip", "acceptance")
"""Metrics that are shown of every motion."""


@dataclass(frozen=True)
class Score:
    """Score the rollouts of a dataset: tracking, Earth Mover's Distance, slip, effort, smoothness, with intervals.

    Example: kine2go dataset score runs/demo/dataset.zarr --json scores.json
    """

    dataset: DatasetPath
    """A dataset made by 'kine2go dataset gather' or 'kine2go run'."""
    motions: MotionNames = ()
    """Names of its motions; by default all of them."""
    json: Path | None = None
    """Write all metrics of all motions to this file."""
    plots: Path | None = None
    """Draw root paths and errors over the cycle of each motion into this folder."""
    overwrite: bool = False
    """Replace a file and pictures that are there already."""

    def run(self) -> int:
        """Score, write and draw, and print tables."""
        from kine2go_warp.cli.progress import tracked
        from kine2go_warp.dataset import open_dataset
        from kine2go_warp.dataset.checked import check_note
        from kine2go_warp.scores.plots import compute_curves, draw
        from kine2go_warp.scores.report import measure, review_note, robot_note, score, scored_motions, write_json

        dataset = open_dataset(self.dataset)
        names = scored_motions(dataset, self.motions)
        self._check_outputs()
        measured, curves = [], []
        for name in tracked(names, "scoring"):
            data = dataset.load(name)
            measured.append(measure(data, dataset.robot))
            if self.plots is not None:
                curves.append(compute_curves(data))
        scores = score(measured)
        if self.json is not None:
            write_json(self.dataset, measured, scores, self.json)
        if self.plots is not None:
            for one in tracked(curves, "drawing"):
                draw(one, self.plots)
        print_scores(scores, self.dataset)
        checked = check_note(self.dataset, names)
        for note in (review_note(dataset, self.motions), robot_note(dataset, dataset.robot), checked):
            if note:
                say(f"{self.dataset}: {note}")
        return 0

    def _check_outputs(self) -> None:
        """Check that nothing will be overwritten by accident, before the work begins.

        Raises:
            DatasetError: something is in the way.
        """
        if self.plots is not None and self.plots.exists() and not self.plots.is_dir():
            raise DatasetError(f"{self.plots}: is a file; name a folder for the pictures")
        if self.json is not None and self.json.is_dir():
            raise DatasetError(f"{self.json}: is a folder; name a file for the metrics")
        if self.overwrite:
            return
        if self.json is not None and self.json.exists():
            raise DatasetError(f"{self.json}: exists; choose another name, or replace it with --overwrite")
        if self.plots is not None and self.plots.is_dir() and any(self.plots.iterdir()):
            raise DatasetError(f"{self.plots}: not empty; choose another folder, or draw into it with --overwrite")


def print_scores(scores: "DatasetScores", dataset: Path) -> None:
    """Print a line for each motion, then all metrics of all of them together."""
    from kine2go_warp.cli.tables import print_table
    from kine2go_warp.scores.registry import METRICS
    from kine2go_warp.tables import Column, make_table, number_text

    motions, known = list(scores.motions), {metric.name: metric for metric in METRICS}
    if len(motions) > 1:
        columns = [Column("motion", number=False)]
        columns += [Column(known[name].heading, known[name].unit) for name in HEADLINES]
        rows = [
            (motion, *(number_text(estimates[name].value) for name in HEADLINES))
            for motion, estimates in scores.motions.items()
        ]
        print_table(make_table(f"{dataset}: motions", columns, rows))
    title = motions[0] if len(motions) == 1 else f"all {len(motions)} motions, each counts the same"
    rows = []
    for metric in METRICS:
        one = scores.overall[metric.name]
        interval = f"{number_text(one.low)} to {number_text(one.high)}"
        rows.append((metric.name, metric.unit, number_text(one.value), interval, metric.better))
    headings = ("metric", "unit", "mean", "95 % interval", "better")
    print_table(make_table(f"{dataset}: {title}", headings, rows, ("metric", "unit", "better")))
