"""Opening recordings in the Rerun viewer."""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from kine2go_warp.errors import RecordingError
from kine2go_warp.interruption import Terminated
from kine2go_warp.recordings.serving import RecordingServer

MEMORY = "2GB"
"""What the viewer, and the server for browsers, may use; above it they drop the oldest recordings."""
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
    command = [str(viewer_program()), "--new", "--bind", "127.0.0.1", "--memory-limit", MEMORY, *map(str, recordings)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    time.sleep(PATIENCE)
    if process.poll() not in (None, 0):
        raise RecordingError("the Rerun viewer ended at once; use --web for a browser, or --save to only write files")


def open_waiting(port: int | None = None) -> str:
    """Open a window that waits for a recording, and return the address to send it to; it stays when this process ends.

    Args:
        port: Where it listens; by default a free port.

    Raises:
        RecordingError: there is no display, the port is in use, or the viewer does not start.
    """
    check_display()
    (port,) = free_ports(1, port)
    command = [str(viewer_program()), "--port", str(port), "--bind", "127.0.0.1", "--memory-limit", MEMORY]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    if not is_listening(process, port):
        process.terminate()
        raise RecordingError("the Rerun viewer does not start; use --web for a browser")
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
    """Where recordings may be sent that are not files."""
    files: RecordingServer | None = None

    @classmethod
    def start(cls, recordings: Sequence[Path], port: int | None = None) -> "WebViewer":
        """Start to serve.

        Args:
            recordings: Files to show; without any the page shows what is sent to ``source``.
            port: Of the page; the data are at the next one. By default both are free ones.

        Raises:
            RecordingError: a port is in use, or the server does not start.
        """
        page, data = free_ports(2, port)
        stream = free_ports(1)[0] if recordings else data
        command = [str(viewer_program()), "--serve-web", "--bind", "127.0.0.1", "--web-viewer-port", str(page)]
        command += ["--port", str(stream), "--server-memory-limit", MEMORY]
        files = RecordingServer(recordings, data, page) if recordings else None
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        source = stream_address(stream)
        query = "&".join(f"url={quote(one, safe='')}" for one in (files.urls if files else [source]))
        viewer = cls(process, f"http://127.0.0.1:{page}/?{query}", source, files)
        if not (is_listening(process, page) and is_listening(process, stream)):
            viewer.stop()
            raise RecordingError("the web server of the Rerun viewer does not start; use --save to only write files")
        return viewer

    def wait(self) -> None:
        """Serve until interrupted or told to end; the server does not outlive this process.

        Raises:
            Terminated: the process was told to end.
        """
        try:
            self.process.wait()
        except Terminated:
            raise
        except KeyboardInterrupt:
            pass
        finally:
            self.stop()

    def stop(self) -> None:
        """Stop serving."""
        if self.files is not None:
            self.files.stop()
        self.process.terminate()
        self.process.wait()


def free_ports(count: int, first: int | None = None) -> list[int]:
    """Return ports of this machine that nobody uses, from a first one on or any.

    Raises:
        RecordingError: one of those asked for is in use.
    """
    wanted = [0] * count if first is None else range(first, first + count)
    probes = [socket.socket() for _ in wanted]
    try:
        for probe, port in zip(probes, wanted, strict=True):
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(("127.0.0.1", port))
            except (OSError, OverflowError) as error:
                raise RecordingError(f"port {port} cannot be used ({error}); choose another --port") from None
        return [probe.getsockname()[1] for probe in probes]
    finally:
        for probe in probes:
            probe.close()
