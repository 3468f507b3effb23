"""The picture of an evaluation: errors over the cycle of the reference under each condition."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from kine2go_warp.evaluation.evaluate import NOISES, WORLDS, condition_name
from kine2go_warp.evaluation.metrics import THRESHOLDS, Result
from kine2go_warp.scores.plots import COLOURS, PHASE_BINS, new_figure, save

PANELS = (
    ("joint_error", "joint_rmse", "joint RMSE [rad]", 1.0),
    ("root_error", "root_error", "root error [cm]", 100.0),
)
"""Curve, the metric that has a threshold, label, and factor to the label's unit."""


def draw_phases(clip: str, results: Sequence[Result], path: Path) -> Path:
    """Draw the errors of one clip and return the picture's path.

    Args:
        clip: Name of the clip.
        results: Its results under all conditions.
        path: Where to write the picture.
    """
    found = {one.condition: one for one in results if one.clip == clip}
    phase = (np.arange(PHASE_BINS) + 0.5) / PHASE_BINS
    figure = new_figure(9.0, 5.5)
    figure.suptitle(f"{clip}: error over the reference cycle, median and 10-90 % of rows", fontsize="medium")
    worlds = [world for world in WORLDS if any(condition_name(noise, world) in found for noise in NOISES)]
    panels = figure.subplots(len(PANELS), len(worlds), sharex=True, sharey="row", squeeze=False)
    for row, (curve, metric, label, factor) in enumerate(PANELS):
        for column, world in enumerate(worlds):
            axes = panels[row][column]
            for colour, noise in zip(COLOURS, NOISES, strict=False):
                if condition_name(noise, world) not in found:
                    continue
                low, middle, high = factor * getattr(found[condition_name(noise, world)], curve)
                axes.fill_between(phase, low, high, color=colour, alpha=0.25, linewidth=0.0)
                axes.plot(phase, middle, color=colour, label=noise)
            threshold = factor * THRESHOLDS[metric]
            axes.axhline(threshold, color="0.3", linestyle="--", linewidth=1.0, label="threshold of the mean")
            axes.set_xlim(0.0, 1.0)
            axes.set_ylim(bottom=0.0)
            axes.grid(color="0.9")
            if row == 0:
                axes.set_title(world, fontsize="medium")
            else:
                axes.set_xlabel("phase of the reference cycle [1]")
            if column == 0:
                axes.set_ylabel(label)
    panels[0][0].legend(fontsize="small")
    return save(figure, path)
