"""The pushes that a robot got, which take a single row each and must be seen all the same."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from kine2go_warp.recordings.stream import Colour, Columns

PUSH_COLOUR: Colour = (232, 76, 160)
PUSH_SCALE = 1.5
"""Length of an arrow by what a push adds to the velocity [s]."""
SHOWN_ROWS = 20
"""For how many rows an arrow is there, beginning with that of the push."""
HEIGHT = 0.12
"""How far above the base the arrow points [m]."""


def log_pushes(columns: Columns, rows: Mapping[str, NDArray[Any]]) -> None:
    """Log an arrow for a while after each push, a mark on the root's way, and one in the plot of errors.

    Older datasets have no pushes.
    """
    if "push" not in rows:
        return
    push = np.asarray(rows["push"], np.float64)
    pushed = np.flatnonzero(np.linalg.norm(push, axis=-1) > 0.0)
    if len(pushed) == 0:
        return
    root = rows["root_position"]
    labels = [f"push {np.linalg.norm(push[row]):.2f} m/s" for row in pushed]
    points = rr.Points3D(root[pushed], colors=[PUSH_COLOUR], radii=0.015, labels=labels, show_labels=False)
    columns.fix("pushes", points)
    log_arrows(columns, root, push, pushed)
    marks = replace(columns, time=columns.time[pushed])
    style = rr.SeriesPoints(colors=[list(PUSH_COLOUR)], names=["push"], markers=["diamond"], marker_sizes=[7.0])
    columns.fix("plots/push", style)
    marks.send("plots/push", rr.Scalars.columns(scalars=np.zeros(len(pushed))))


def log_arrows(columns: Columns, root: NDArray[Any], push: NDArray[Any], pushed: NDArray[Any]) -> None:
    """Log an arrow that goes with the robot from each push on, with its size as a text."""
    last = np.full(len(push), -1)
    for row in pushed:
        last[row : row + SHOWN_ROWS] = row
    is_shown = last >= 0
    # One row without an arrow after the last one with it makes it go.
    wanted = is_shown | np.roll(is_shown, 1)
    origins = (root + np.array([0.0, 0.0, HEIGHT]))[is_shown].astype(np.float32)
    vectors = (PUSH_SCALE * push[last[is_shown]]).astype(np.float32)
    labels = [f"push {np.linalg.norm(push[row]):.2f} m/s" for row in last[is_shown]]
    columns.fix("push", rr.Arrows3D.from_fields(colors=[PUSH_COLOUR], radii=[0.01], show_labels=True))
    arrows = rr.Arrows3D.columns(origins=origins, vectors=vectors, labels=labels)
    replace(columns, time=columns.time[wanted]).send("push", arrows, is_shown[wanted].astype(int))
