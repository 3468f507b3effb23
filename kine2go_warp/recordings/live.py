"""Where a recording goes while it is made: to a viewer, or piece by piece into a file."""

import shutil
from pathlib import Path
from typing import Protocol

import rerun as rr

from kine2go_warp.errors import RecordingError
from kine2go_warp.files import flush_to_disk, temporary_sibling

PATIENCE = 5.0
"""How long a viewer may take to accept what is left when a recording ends [s]."""
LEAST_SPACE = 20_000_000
"""A file grows no further when less is free on its disk [bytes]."""


class Sink(Protocol):
    """Takes a recording while it is made."""

    def open(self, recording: rr.RecordingStream) -> None:
        """Begin to take it."""
        ...

    def flush(self) -> None:
        """Take what has been logged so far."""
        ...

    def close(self) -> None:
        """End."""
        ...


class ViewerSink:
    """A viewer that listens at an address."""

    def __init__(self, url: str) -> None:
        self.url = url

    def open(self, recording: rr.RecordingStream) -> None:
        """Connect to the viewer."""
        self.recording = recording
        recording.connect_grpc(self.url)

    def flush(self) -> None:
        """Do nothing: what is logged is sent at once."""

    def close(self) -> None:
        """Send what is left, unless the viewer has gone."""
        self.recording.flush(timeout_sec=PATIENCE)
        self.recording.disconnect()


class FileSink:
    """A file that grows under a temporary name and is renamed at the end, also where that comes early."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.temporary = temporary_sibling(path)

    def open(self, recording: rr.RecordingStream) -> None:
        """Begin the file."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.recording = recording
        recording.save(self.temporary)

    def flush(self) -> None:
        """Check that there is room; the library's own file writer only logs an error when the disk is full.

        Raises:
            RecordingError: there is none.
        """
        if shutil.disk_usage(self.path.parent).free < LEAST_SPACE:
            raise RecordingError(f"{self.path}: no space left on the disk")

    def close(self) -> None:
        """Write what is left and rename the file."""
        self.recording.flush(timeout_sec=PATIENCE)
        self.recording.disconnect()
        flush_to_disk(self.temporary)
        self.temporary.replace(self.path)
