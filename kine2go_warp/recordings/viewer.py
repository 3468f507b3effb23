"""Opening recordings in the Rerun viewer."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from kine2go_warp.errors import RecordingError

PATIENCE = 1.0
"""A viewer that ends sooner than this has failed [s]."""


def viewer_program() -> Path:
    """Return the viewer itself, rather than the script that starts it and cannot be ended.

    Raises:
        RecordingError: it is not installed.
    """
    try:
        import rerun_cli
    except ImportError:
        raise RecordingError("the Rerun viewer is not installed; install 'rerun-sdk'") from None
    return Path(str(rerun_cli.__file__)).parent / ("rerun.exe" if sys.platform == "win32" else "rerun")


def check_display(
    otherwise: str = "--web for a browser, or --save to only write files", environment: Mapping[str, str] = os.environ
) -> None:
    """Check that a window can be opened.

    Args:
        otherwise: What to use where it cannot.
        environment: Variables of the environment.

    Raises:
        RecordingError: there is no display.
    """
    needs_one = sys.platform.startswith("linux")
    if needs_one and not (environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY")):
        raise RecordingError(f"no display to open the viewer on; use {otherwise}")


def open_native(recordings: Sequence[Path]) -> None:
    """Open a window with recordings; it stays when this process ends.

    Raises:
        RecordingError: there is no display, or the viewer does not start.
    """
    check_display()
    command = [str(viewer_program()), "--new", "--bind", "127.0.0.1", *map(str, recordings)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    time.sleep(PATIENCE)
    if process.poll() not in (None, 0):
        raise RecordingError("the Rerun viewer ended at once; use --web for a browser, or --save to only write files")


def open_waiting() -> str:
    """Open a window that waits for a recording, and return the address to send it to; it stays when this process ends.

    Raises:
        RecordingError: there is no display, or the viewer does not start.
    """
    check_display()
    (port,) = free_ports(1)
    command = [str(viewer_program()), "--port", str(port), "--bind", "127.0.0.1"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    if not is_listening(process, port):
        process.terminate()
        raise RecordingError("the Rerun viewer does not start; use --rerun-web for a browser, or --rerun-save")
    return stream_address(port)


def stream_address(port: int) -> str:
    """Return where a viewer or server on this machine takes recordings."""
    return f"rerun+http://127.0.0.1:{port}/proxy"


def is_listening(process: subprocess.Popen[bytes], port: int, limit: float = 20.0) -> bool:
    """Wait until somebody listens at a port; return False if the process ends before or it takes too long [s]."""
    end = time.monotonic() + limit
    while time.monotonic() < end and process.poll() is None:
        with socket.socket() as probe:
            probe.settimeout(0.5)
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return True
        time.sleep(0.1)
    return False


@dataclass
class WebViewer:
    """Serves recordings to browsers of this machine."""

    process: subprocess.Popen[bytes]
    url: str
    """The page to open."""
    source: str
    """Where further recordings may be sent."""

    @classmethod
    def start(cls, recordings: Sequence[Path]) -> "WebViewer":
        """Start to serve.

        Raises:
            RecordingError: the server does not start.
        """
        page, data = free_ports(2)
        command = [str(viewer_program()), "--serve-web", "--bind", "127.0.0.1", "--web-viewer-port", str(page)]
        command += ["--port", str(data), "--server-memory-limit", "25%", *map(str, recordings)]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        source = stream_address(data)
        viewer = cls(process, f"http://127.0.0.1:{page}/?url={quote(source, safe='')}", source)
        if not (is_listening(process, page) and is_listening(process, data)):
            viewer.stop()
            raise RecordingError("the web server of the Rerun viewer does not start; use --save to only write files")
        return viewer

    def wait(self) -> None:
        """Serve until interrupted or told to end; the server does not outlive this process."""
        before = signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
        try:
            self.process.wait()
        except KeyboardInterrupt:
            pass
        finally:
            self.stop()
            signal.signal(signal.SIGTERM, before)

    def stop(self) -> None:
        """Stop serving."""
        self.process.terminate()
        self.process.wait()


def free_ports(count: int) -> list[int]:
    """Return ports of this machine that nobody uses."""
    probes = [socket.socket() for _ in range(count)]
    try:
        for probe in probes:
            probe.bind(("127.0.0.1", 0))
        return [probe.getsockname()[1] for probe in probes]
    finally:
        for probe in probes:
            probe.close()
