"""Learning curves of the trainings of an ablation, as a picture."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.env.config import EnvConfig
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.files import atomic_file

Array = NDArray[np.float64]

COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#000000", "#999999")
"""Of Okabe and Ito, which people with any colour vision can tell apart; and a grey."""
COLUMNS = 3


def draw_curves(records: Sequence[dict[str, Any]], path: Path) -> None:
    """Draw how long episodes last while training goes on: a panel a motion, a line a choice, a band over its seeds.

    Raises:
        Kine2GoError: there are no results.
    """
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib.figure import Figure

    motions = list(dict.fromkeys(record["motion"] for record in records))
    choices = list(dict.fromkeys(record["choice"] for record in records))
    if not motions:
        raise Kine2GoError("there are no results to draw")
    columns = min(COLUMNS, len(motions))
    rows = -(-len(motions) // columns)
    figure = Figure(figsize=(3.6 * columns, 2.7 * rows + 0.4), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False, sharey=True).ravel()
    for panel in panels[len(motions) :]:
        panel.axis("off")
    for panel, motion in zip(panels, motions, strict=False):
        for choice in choices:
            found = [record for record in records if (record["motion"], record["choice"]) == (motion, choice)]
            if not found:
                continue
            steps, lowest, middle, highest = band(found)
            colour = COLOURS[choices.index(choice) % len(COLOURS)]
            panel.fill_between(steps, lowest, highest, color=colour, alpha=0.15, linewidth=0)
            panel.plot(steps, middle, color=colour, linewidth=1.5, label=choice)
        panel.set_title(motion, fontsize=9)
        panel.set_xlabel("environment steps (thousands)")
        panel.set_ylabel("episode length [s]")
        panel.grid(alpha=0.3)
    if len(choices) > 1:
        panels[0].legend(fontsize=7, loc="upper left")
    with atomic_file(path) as temporary:
        figure.savefig(temporary, dpi=110, format="png")


def band(found: Sequence[dict[str, Any]]) -> tuple[Array, Array, Array, Array]:
    """Return steps [thousands] and the least, median and greatest episode length over seeds [s]."""
    shortest = min(len(record["curve"]) for record in found)
    steps = np.array([point["steps"] for point in found[0]["curve"][:shortest]]) / 1e3
    lengths = np.array([[point["episode_length"] for point in record["curve"][:shortest]] for record in found])
    seconds = lengths / EnvConfig().control_rate
    return steps, seconds.min(axis=0), np.median(seconds, axis=0), seconds.max(axis=0)
