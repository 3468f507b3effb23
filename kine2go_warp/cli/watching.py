"""Where to a training is shown."""

from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from kine2go_warp.cli.texts import say
from kine2go_warp.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from kine2go_warp.recordings.training import TrainingRecording
    from kine2go_warp.robots import RobotSpec


@contextmanager
def watching(
    name: str, spec: "RobotSpec", window: bool, web: bool, save: Path | None
) -> "Iterator[TrainingRecording | None]":
    """Yield who watches a training, None if nobody does. Say afterwards if watching ended before it.

    Args:
        name: Of the training.
        spec: The robot.
        window: Open a window.
        web: Serve a page to browsers.
        save: Write a file.

    Raises:
        RecordingError: the options do not fit together, there is no display, or the viewer does not start.
    """
    if window + web + (save is not None) > 1:
        raise RecordingError("choose one of --rerun, --rerun-web and --rerun-save")
    if not (window or web or save):
        yield None
        return
    from kine2go_warp.recordings.live import FileSink, ViewerSink
    from kine2go_warp.recordings.training import TrainingRecording
    from kine2go_warp.recordings.viewer import WebViewer, check_display, open_waiting

    if window:
        check_display("--rerun-web for a browser, or --rerun-save FILE to only write a file")
    server = None
    if save is not None:
        sink = FileSink(checked(save))
    elif web:
        server = WebViewer.start([])
        say(f"open {server.url} while the training runs")
        sink = ViewerSink(server.source)
    else:
        sink = ViewerSink(open_waiting())
    recording = TrainingRecording(name, spec, sink)
    try:
        with recording:
            yield recording
    finally:
        if server is not None:
            server.stop()
        if recording.problem:
            say(f"kine2go: the training was not watched to its end: {recording.problem}", error=True)
        elif save is not None:
            say(f"{save}: {save.stat().st_size / 1e6:.1f} MB, written")


def checked(path: Path) -> Path:
    """Return a path that a recording may be written to.

    Raises:
        RecordingError: it is no name of a recording, or something else lies there.
    """
    if path.suffix != ".rrd":
        raise RecordingError(f"{path}: name a file that ends in .rrd")
    if path.exists():
        raise RecordingError(f"{path}: exists; choose another name, or remove it")
    return path
