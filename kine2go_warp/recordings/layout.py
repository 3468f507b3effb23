"""How the viewer is laid out: a tab for each trajectory, the one closest to a limit first, and one with all of them."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import rerun.blueprint as rrb
from numpy.typing import NDArray

from kine2go_warp.dataset.limit_usage import LimitUsage
from kine2go_warp.dataset.motion import Trajectory
from kine2go_warp.recordings.robot import EYE, FOLLOWED
from kine2go_warp.recordings.stream import TIMELINE
from kine2go_warp.recordings.trajectory import trajectory_entity
from kine2go_warp.robots import RobotSpec
from kine2go_warp.rotations import heading, turn_planar

FAR_EYE = (5.0, -7.0, 6.0)
"""Where the eye is that looks at all robots [m]."""

BACKGROUND = (24, 26, 32)
FLOOR = (70, 74, 84, 150)
CELL = 0.5
"""Size of the squares on the floor [m]."""


Vector = tuple[float, float, float]


def motion_layout(motion: str, shown: Sequence[tuple[Trajectory, LimitUsage]], spec: RobotSpec) -> rrb.Blueprint:
    """Return the layout of a motion's recording, with tabs in the order of ``shown``."""
    tabs = [trajectory_tab(one, usage, spec) for one, usage in shown]
    robots = [f"+ /{trajectory_entity(one.index)}/{part}/**" for one, _ in shown for part in ("robot", "paths")]
    everything = rrb.Horizontal(
        scene(f"{motion}: all trajectories", "/", robots, FAR_EYE, (0.0, 0.0, 0.0), None),
        rrb.TextDocumentView(name="by limit usage", origin="/list"),
        column_shares=[3, 2],
        name=f"all {len(shown)}",
    )
    return whole(rrb.Tabs(*tabs, everything, name=motion, active_tab=0))


def whole(content: rrb.Container | rrb.View) -> rrb.Blueprint:
    """Return a layout with the timeline, and without what a reviewer does not need."""
    return rrb.Blueprint(
        content,
        rrb.TimePanel(timeline=TIMELINE, state="collapsed", loop_mode="all"),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        auto_layout=False,
        auto_views=False,
    )


def trajectory_tab(one: Trajectory, usage: LimitUsage, spec: RobotSpec) -> rrb.Horizontal:
    """Return the views of one trajectory."""
    entity = trajectory_entity(one.index)
    share = "" if math.isinf(usage.worst_limit_ratio) else f" ({usage.worst_limit_ratio:.0%})"
    start = one.arrays["root_position"][0]
    plots = rrb.Vertical(
        curves("errors / limits", f"{entity}/plots", ["errors", "limit", "push"]),
        rrb.Tabs(*[curves(f"{leg.name} joints [rad]", f"{entity}/plots/joints/{leg.name}") for leg in spec.legs]),
        curves("reward terms", f"{entity}/plots/reward"),
        rrb.Tabs(
            curves("foot force [N]", f"{entity}/plots/force"),
            curves("leg distance [m]", f"{entity}/plots/leg_distance"),
        ),
        row_shares=[3, 3, 2, 2],
    )
    parts = ("robot", "reference", "targets", "forces", "paths", "push", "pushes")
    space = [f"+ /{entity}/{part}/**" for part in parts]
    return rrb.Horizontal(
        scene(
            f"trajectory {one.index}",
            f"/{entity}",
            space,
            tuple(start + turned(EYE, one.arrays["root_orientation"][0])),
            tuple(start),
            f"/{entity}/robot/{FOLLOWED}",
        ),
        plots,
        rrb.TextDocumentView(name="metrics", origin=f"{entity}/text"),
        column_shares=[9, 6, 5],
        name=f"{one.index}{share}",
    )


def turned(vector: Vector, orientation: NDArray[Any]) -> NDArray[Any]:
    """Turn a vector about the vertical by the heading of an orientation (w, x, y, z)."""
    return turn_planar(np.asarray(vector), heading(orientation))


def scene(
    name: str, origin: str, contents: list[str], eye: Vector, target: Vector, follow: str | None
) -> rrb.Spatial3DView:
    """Return a view of the space, with a floor and an eye that may follow an entity."""
    return rrb.Spatial3DView(
        name=name,
        origin=origin,
        contents=contents,
        background=rrb.Background(color=BACKGROUND),
        line_grid=rrb.LineGrid3D(visible=True, spacing=CELL, stroke_width=1.0, color=FLOOR),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=eye, look_target=target, tracking_entity=follow
        ),
    )


def curves(name: str, origin: str, parts: list[str] | None = None) -> rrb.TimeSeriesView:
    """Return a plot of the curves at an entity, or at some entities below it."""
    contents = "$origin/**" if parts is None else [f"+ $origin/{part}" for part in parts]
    # It would cover a third of a plot; the text of a trajectory names the colours.
    legend = rrb.PlotLegend(visible=False)
    return rrb.TimeSeriesView(name=name, origin=origin, contents=contents, plot_legend=legend)
