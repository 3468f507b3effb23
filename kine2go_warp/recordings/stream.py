"""Writing recordings: columns on one timeline, and files that appear whole."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from kine2go_warp.files import atomic_file

TIMELINE, ITERATION = "time", "iteration"

Colour = tuple[int, ...]
"""Red, green, blue and, if it is not 255, opacity."""

THIN, THICK = -0.8, -1.5
"""Radii of lines; negative ones are points of the screen rather than metres, so that lines look alike from afar."""

LEG_COLOURS: dict[str, Colour] = {
    "FL": (239, 108, 98),
    "FR": (98, 160, 234),
    "RL": (245, 178, 66),
    "RR": (94, 200, 178),
}


@contextmanager
def recording_file(name: str, content: str, path: Path) -> Iterator[rr.RecordingStream]:
    """Yield a recording to log to; it is written to ``path`` if the block succeeds.

    Args:
        name: Shown in the viewer.
        content: Identifies what is recorded, so that viewers tell recordings apart.
        path: The file.
    """
    rr.set_strict_mode(True)
    # Viewers keep one layout for each application, so each motion is one of its own.
    recording = rr.RecordingStream(f"kine2go {name}", recording_id=f"{name}-{content}")
    # Through memory, since the library's own file writer only logs an error when the disk is full.
    memory = recording.memory_recording()
    with recording:
        recording.send_recording_name(name)
        recording.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        yield recording
    with atomic_file(path) as temporary:
        temporary.write_bytes(memory.drain_as_bytes() or b"")


@dataclass(frozen=True)
class Columns:
    """Sends whole columns to entities below one path, all at the same instants."""

    recording: rr.RecordingStream
    path: str
    """What the entities lie below."""
    time: NDArray[np.float64]
    """Instants of the rows [s], shape [num_rows]."""
    with_fixed: bool = True
    """Whether to log what never changes; not wanted where it has been logged before."""

    def below(self, entity: str) -> "Columns":
        """Return the same for entities below one of these."""
        return replace(self, path=f"{self.path}/{entity}")

    def send(self, entity: str, columns: rr.ComponentColumnList, sizes: int | NDArray[Any] | None = None) -> None:
        """Log what changes from row to row.

        Args:
            entity: Name below the path.
            columns: The values of all rows, one row after the other.
            sizes: How many instances a row has, one number or one a row; by default one instance.
        """
        if sizes is not None:
            columns = columns.partition(np.broadcast_to(sizes, len(self.time)))
        instants = np.round(np.asarray(self.time, np.float64) * 1e9).astype("timedelta64[ns]")
        index = rr.TimeColumn(TIMELINE, duration=instants)  # pyright: ignore[reportArgumentType, reportCallIssue]
        self.recording.send_columns(f"{self.path}/{entity}", [index], columns)

    def fix(self, entity: str, value: rr.AsComponents) -> None:
        """Log what never changes."""
        if not self.with_fixed:
            return
        self.recording.log(f"{self.path}/{entity}", value, static=True)

    def curves(
        self, entity: str, values: NDArray[Any], names: Iterable[str], colours: Iterable[Colour], width: float = 1.5
    ) -> None:
        """Log several curves as one entity, ``values`` of shape [num_rows, num_curves]."""
        values = np.asarray(values, np.float64)
        widths = [width] * values.shape[1]
        style = rr.SeriesLines(colors=[list(colour) for colour in colours], names=list(names), widths=widths)
        self.fix(entity, style)
        self.send(entity, rr.Scalars.columns(scalars=values.reshape(-1)), values.shape[1])
