"""A training to watch: some worlds beside their references, and the curves, drawn by a thread of its own."""

import math
import threading
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from types import TracebackType

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from kine2go_warp.metrics import CONTACT_FORCE
from kine2go_warp.recordings.layout import curves, scene
from kine2go_warp.recordings.live import Sink
from kine2go_warp.recordings.robot import EYE, FOLLOWED, RobotDrawer
from kine2go_warp.recordings.shapes import Poses, compute_poses
from kine2go_warp.recordings.stream import ITERATION, TIMELINE, Colour, Columns
from kine2go_warp.recordings.trajectory import ERROR_COLOURS, TERM_COLOURS
from kine2go_warp.robots import RobotSpec

PACE = 1.0
"""How often what was seen is drawn [s]."""
BACKLOG = 400
"""Blocks that wait to be drawn; beyond that the oldest are dropped rather than the training slowed down."""

GROUPS: dict[str, tuple[str, tuple[Colour, ...]]] = {
    "reward": ("reward terms, a step", TERM_COLOURS),
    "error": ("errors [m, rad]", ERROR_COLOURS),
    "return": ("reward of an episode", ((98, 160, 234),)),
    "length": ("length of an episode [steps]", ((94, 200, 178),)),
    "evaluation": ("errors of the mean action [rad, m, m/s]", TERM_COLOURS),
    "evaluation_shares": ("rollouts of the mean action that last, or are accepted", TERM_COLOURS),
    "speed": ("training [steps/s]", ((200, 200, 200),)),
}
"""Groups of curves with their titles and colours, in the order of the layout."""

Rows = Mapping[str, NDArray[np.float32]]


@dataclass(frozen=True)
class Worlds:
    """Some worlds over some control steps."""

    time: NDArray[np.float64]
    rows: Rows


@dataclass(frozen=True)
class Iteration:
    """The metrics of an iteration."""

    time: float
    number: int
    curves: Mapping[str, float]


class TrainingRecording:
    """Draws what it is shown of a training. Use it as a context manager.

    Whoever trains only leaves arrays here. A thread draws them, and if that fails, the training goes on unwatched and
    ``problem`` says why.
    """

    def __init__(self, name: str, spec: RobotSpec, sink: Sink) -> None:
        """Begin a recording.

        Args:
            name: Shown in the viewer.
            spec: The robot.
            sink: Where it goes.
        """
        rr.set_strict_mode(True)
        self.recording = rr.RecordingStream(f"kine2go training {name}")
        self.name, self.sink, self.drawer = name, sink, RobotDrawer(spec)
        self.problem = ""
        self._seen: deque[Worlds | Iteration] = deque(maxlen=BACKLOG)
        self._drawn_worlds = 0
        self._drawn_groups: set[str] = set()
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._draw_until_over, name="kine2go recording", daemon=True)

    def __enter__(self) -> "TrainingRecording":
        self.sink.open(self.recording)
        self.recording.send_recording_name(f"training {self.name}")
        self.recording.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._is_over.set()
        self._thread.join()

    def on_worlds(self, time: NDArray[np.float64], rows: Rows) -> None:
        """Take rows of shape [num_worlds, num_steps, ...], named as in the dataset."""
        self._seen.append(Worlds(time, rows))

    def on_iteration(self, time: float, iteration: int, curves: Mapping[str, float]) -> None:
        """Take the metrics of an iteration, by ``group/name``."""
        self._seen.append(Iteration(time, iteration, curves))

    def _draw_until_over(self) -> None:
        """Draw what was seen, again and again, and close the sink in the end."""
        try:
            while not self._is_over.wait(PACE):
                self._draw()
            self._draw()
        except Exception as error:  # noqa: BLE001 - whatever it is, it must not stop the training
            self.problem = f"{error.__class__.__name__}: {error}"
        try:
            self.sink.close()
        except Exception as error:  # noqa: BLE001 - as above
            self.problem = self.problem or f"{error.__class__.__name__}: {error}"

    def _draw(self) -> None:
        """Draw all that was seen and not drawn."""
        seen = [self._seen.popleft() for _ in range(len(self._seen))]
        worlds = [one for one in seen if isinstance(one, Worlds)]
        if worlds:
            time = np.concatenate([one.time for one in worlds])
            parts = worlds[0].rows
            self._draw_worlds(
                time, {name: np.concatenate([one.rows[name] for one in worlds], axis=1) for name in parts}
            )
        for one in seen:
            if isinstance(one, Iteration):
                self._draw_curves(one)
        if seen:
            self.sink.flush()

    def _draw_worlds(self, time: NDArray[np.float64], rows: Rows) -> None:
        """Draw robots and references."""
        num_worlds = len(rows["root_position"])
        is_first = self._drawn_worlds == 0
        if is_first:
            self.recording.send_blueprint(training_layout(self.name, rows))
            self._drawn_worlds = num_worlds
        # In one go, since most of the time goes into the number of calls.
        states, references = (self._poses(rows, prefix) for prefix in ("", "reference_"))
        standing = np.linalg.norm(rows["foot_contact_force"], axis=-1) > CONTACT_FORCE
        for world in range(num_worlds):
            part = slice(world * len(time), (world + 1) * len(time))
            columns = Columns(self.recording, f"worlds/{world}", time, with_fixed=is_first)
            self.drawer.draw(columns.below("robot"), states.rows(part), standing[world])
            self.drawer.draw_ghost(columns.below("reference"), references.rows(part))

    def _poses(self, rows: Rows, prefix: str) -> Poses:
        """Return the poses of all worlds, one world after the other."""
        parts = [rows[f"{prefix}{name}"] for name in ("root_position", "root_orientation", "joint_position")]
        return compute_poses(self.drawer.spec, *(part.reshape(-1, part.shape[-1]) for part in parts))

    def _draw_curves(self, one: Iteration) -> None:
        """Draw one point of every curve, on the timeline of the worlds and on one of iterations."""
        groups: dict[str, dict[str, float]] = {}
        for name, value in one.curves.items():
            group, _, label = name.partition("/")
            groups.setdefault(group, {})[label.replace("_", " ")] = value
        self.recording.set_time(TIMELINE, duration=one.time)
        self.recording.set_time(ITERATION, sequence=one.number)
        for group, values in groups.items():
            if group not in self._drawn_groups:
                self._drawn_groups.add(group)
                colours = [list(colour) for colour in GROUPS[group][1][: len(values)]]
                style = rr.SeriesLines(colors=colours, names=list(values), widths=[1.5] * len(values))
                self.recording.log(f"curves/{group}", style, static=True)
            # What is not known yet, such as the length of episodes before the first one ends, is no point.
            if not any(math.isnan(value) for value in values.values()):
                self.recording.log(f"curves/{group}", rr.Scalars(list(values.values())))
        self.recording.reset_time()


def training_layout(name: str, rows: Rows) -> rrb.Blueprint:
    """Return the layout: a view for each world, whose eye follows the robot, and the curves."""
    views = []
    for world in range(len(rows["root_position"])):
        start, entity = rows["root_position"][world, 0], f"/worlds/{world}"
        parts = [f"+ {entity}/{part}/**" for part in ("robot", "reference")]
        eye = tuple(start + np.array(EYE))
        views.append(scene(f"world {world}", entity, parts, eye, tuple(start), f"{entity}/robot/{FOLLOWED}"))
    plots = [curves(title, f"/curves/{group}") for group, (title, _) in GROUPS.items()]
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Grid(*views, grid_columns=2),
            rrb.Vertical(*plots, row_shares=[3, 3, 2, 2, 3, 2, 2]),
            column_shares=[3, 2],
            name=f"training {name}",
        ),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed", play_state="following"),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        auto_layout=False,
        auto_views=False,
    )
