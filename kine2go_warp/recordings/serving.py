"""Recordings for the viewer in a browser, as files.

The viewer reads a file in its own order, so that what comes first is shown first. Rerun's own server for streams sends
all that never changes before the rest, layouts included, and its messages cost a browser twice the processor time.
"""

import shutil
from collections.abc import Sequence
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from urllib.parse import quote


class RecordingServer:
    """Serves some files at a port of this machine, from a thread, to the page at another port."""

    def __init__(self, recordings: Sequence[Path], port: int, page: int) -> None:
        """Begin to serve.

        Args:
            recordings: The files.
            port: Where they are served.
            page: Port of the page that may read them.
        """
        files = {f"/{number}/{quote(path.name)}": path for number, path in enumerate(recordings)}
        origins = {f"http://{host}:{page}" for host in ("127.0.0.1", "localhost")}

        class Handler(BaseHTTPRequestHandler):
            """Answers with one of the files."""

            def do_GET(self) -> None:
                """Send a file, whole."""
                path = files.get(self.path)
                if path is None or not path.is_file():
                    self.send_error(404)
                    return
                with path.open("rb") as file:
                    self.send_response(200)
                    if (origin := self.headers.get("Origin", "")) in origins:
                        self.send_header("Access-Control-Allow-Origin", origin)
                    self.send_header("Content-Type", "application/octet-stream")
                    self.send_header("Content-Length", str(path.stat().st_size))
                    self.end_headers()
                    with suppress(ConnectionError):  # the page was closed
                        shutil.copyfileobj(file, self.wfile)

            def log_message(self, format: str, *args: object) -> None:  # noqa: A002
                """Say nothing."""

        self._server = ThreadingHTTPServer(("127.0.0.1", port), Handler)
        self.urls = [f"http://127.0.0.1:{port}{name}" for name in files]
        Thread(target=self._server.serve_forever, daemon=True).start()

    def stop(self) -> None:
        """Stop serving."""
        self._server.shutdown()
        self._server.server_close()
