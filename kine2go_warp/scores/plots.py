"""Pictures of a motion: where its rollouts went, and where in the cycle they are off."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.motion import MotionData
from kine2go_warp.files import atomic_file
from kine2go_warp.metrics import joint_rmse, root_error
from kine2go_warp.rotations import heading
from kine2go_warp.tables import counted

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00")
"""Of Okabe and Ito, which people with any colour vision can tell apart."""
PHASE_BINS = 30
"""Places of the cycle at which errors are shown."""
HEADINGS = 3
"""Places of each path at which the robot's heading is shown, beyond its start."""


@dataclass(frozen=True)
class MotionCurves:
    """What the pictures of a motion show, small enough to keep for many motions."""

    motion: str
    paths: list[Array]
    """Places of the root in the plane [m], shapes [num_rows, 2]."""
    headings: list[Array]
    """Directions of the base's x axis in the plane [rad], shapes [num_rows]."""
    joint_error: Array
    """10 %, 50 % and 90 % quantiles of the rows' joint RMSE [rad] by phase, shape [3, PHASE_BINS]; NaN for none."""
    root_error: Array
    """The same of the root's distance from its reference [m]."""
    leg_distance: Array
    """The same of the legs' least distance from one another and the trunk [m]."""


def compute_curves(data: MotionData) -> MotionCurves:
    """Reduce a motion to what is drawn."""
    rows, lengths = data.trajectories.rows, data.trajectories.draws["length"]
    headings = heading(rows["root_orientation"])
    return MotionCurves(
        motion=data.name,
        paths=[
            path[:length, :2].astype(np.float64) for path, length in zip(rows["root_position"], lengths, strict=True)
        ],
        headings=[yaw[:length] for yaw, length in zip(headings, lengths, strict=True)],
        joint_error=quantiles_by_phase(rows["phase"], joint_rmse(rows)),
        root_error=quantiles_by_phase(rows["phase"], root_error(rows)),
        leg_distance=quantiles_by_phase(rows["phase"], rows["leg_distance"]),
    )


def quantiles_by_phase(phase: NDArray[Any], values: NDArray[Any]) -> Array:
    """Return 10 %, 50 % and 90 % quantiles of ``values`` in equal bins of ``phase``, shape [3, PHASE_BINS]."""
    there = ~np.isnan(values)
    place = np.minimum((phase[there] * PHASE_BINS).astype(int), PHASE_BINS - 1)
    result = np.full((3, PHASE_BINS), np.nan)
    for one in np.unique(place):
        result[:, one] = np.quantile(values[there][place == one], [0.1, 0.5, 0.9])
    return result


def draw(curves: MotionCurves, folder: Path) -> list[Path]:
    """Draw both pictures of a motion and return their paths."""
    pictures = {"coverage": draw_coverage(curves), "phase": draw_phase(curves)}
    return [save(figure, folder / f"{curves.motion}_{name}.png") for name, figure in pictures.items()]


def draw_coverage(curves: MotionCurves) -> "Figure":
    """Draw the root's path in every trajectory from above, with arrows that show where the robot faces."""
    figure = new_figure(6.0, 6.0)
    axes = figure.add_subplot()
    size = float(np.ptp(np.concatenate(curves.paths), axis=0).max()) or 1.0
    for index, (path, yaw) in enumerate(zip(curves.paths, curves.headings, strict=True)):
        colour = COLOURS[index % len(COLOURS)]
        axes.plot(*path.T, color=colour, linewidth=1.0)
        axes.plot(*path[0], color=colour, marker="o", markersize=4, linestyle="none")
        shown = np.linspace(0, len(path) - 1, HEADINGS + 1).round().astype(int)[1:]
        arrow = 0.05 * size * np.stack([np.cos(yaw[shown]), np.sin(yaw[shown])])
        axes.quiver(*path[shown].T, *arrow, color=colour, angles="xy", scale_units="xy", scale=1.0, width=0.005)
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    axes.margins(0.08)
    paths = counted(len(curves.paths), "trajectory")
    axes.set_title(f"{curves.motion}: root paths of {paths}\ndot: start, arrows: heading")
    axes.grid(color="0.9")
    return figure


def draw_phase(curves: MotionCurves) -> "Figure":
    """Draw errors and the legs' least distance over the reference cycle."""
    figure = new_figure(6.0, 6.0)
    figure.suptitle(f"{curves.motion}: errors and leg distance over the reference cycle", fontsize="medium")
    phase = (np.arange(PHASE_BINS) + 0.5) / PHASE_BINS
    panels = (
        (curves.joint_error, "joint RMSE [rad]", 1.0),
        (curves.root_error, "root error [cm]", 100.0),
        (curves.leg_distance, "leg distance [cm]", 100.0),
    )
    for row, (quantiles, label, factor) in enumerate(panels):
        axes = figure.add_subplot(len(panels), 1, row + 1)
        low, middle, high = factor * quantiles
        axes.fill_between(phase, low, high, color=COLOURS[4], alpha=0.5, linewidth=0.0, label="10-90 %")
        axes.plot(phase, middle, color=COLOURS[0], label="median")
        axes.set(ylabel=label, xlim=(0.0, 1.0))
        # Legs that overlap have a negative distance.
        axes.set_ylim(bottom=min(0.0, np.nanmin(low, initial=0.0)))
        axes.grid(color="0.9")
        if row == 0:
            axes.legend(ncols=2, fontsize="small", loc="lower right")
    axes.set_xlabel("phase of the reference cycle [1]")
    return figure


def new_figure(width: float, height: float) -> "Figure":
    """Return a figure that needs no display, sizes in inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save(figure: "Figure", path: Path) -> Path:
    """Write a figure as a whole file or not at all."""
    with atomic_file(path) as temporary:
        figure.savefig(temporary, dpi=100)
    return path
