"""Checking the source clips, and fetching them from an address of the user's choice."""

import http.client
import os
import urllib.error
import urllib.request
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from kine2go_warp.errors import CatalogueError, Kine2GoError
from kine2go_warp.files import sha256_of
from kine2go_warp.motions.catalogue_entry import CatalogueEntry

CHUNK = 1 << 16
TIMEOUT = 30.0
"""How long a server may be silent [s]."""


@dataclass(frozen=True)
class FileState:
    """Whether a motion's file can be used."""

    file: str
    state: str
    """``whole``, ``there`` (no checksum known), ``damaged`` or ``missing``."""


def check_file(entry: CatalogueEntry, data_folder: Path | None) -> FileState:
    """Return whether the file of a motion is there and what the catalogue expects."""
    if not entry.is_there(data_folder):
        return FileState(entry.file, "missing")
    if not entry.sha256:
        return FileState(entry.file, "there")
    digest = sha256_of(entry.motion_source.data_file(entry.path(data_folder)))
    return FileState(entry.file, "whole" if digest == entry.sha256 else "damaged")


def fetch_file(
    entry: CatalogueEntry, base_url: str, data_folder: Path, on_bytes: Callable[[int, int], None] | None = None
) -> Path:
    """Download the file of a motion, going on where an earlier attempt stopped.

    Args:
        entry: The motion.
        base_url: Address below which files lie as in the data folder.
        data_folder: Where to.
        on_bytes: Called with the bytes there so far and their total (0 if the server does not tell).

    Raises:
        Kine2GoError: the server cannot be reached, does not have the file, or sends something else.
    """
    target = entry.motion_source.data_file(data_folder / entry.file)
    address = f"{base_url.rstrip('/')}/{target.relative_to(data_folder).as_posix()}"
    if not address.startswith(("http://", "https://")):
        raise CatalogueError(f"{base_url}: not an address that begins with http:// or https://")
    partial = target.with_name(target.name + ".part")
    partial.parent.mkdir(parents=True, exist_ok=True)
    try:
        _download(address, partial, on_bytes)
    except (urllib.error.URLError, http.client.HTTPException, TimeoutError, ConnectionError) as error:
        reason = getattr(error, "reason", error)
        raise Kine2GoError(f"{address}: cannot be fetched ({reason}); run the same command again to go on") from None
    if entry.sha256 and sha256_of(partial) != entry.sha256:
        partial.unlink()
        raise Kine2GoError(f"{address}: is not the file that the catalogue expects (SHA-256 differs); removed it")
    partial.replace(target)
    return target


def _download(address: str, partial: Path, on_bytes: Callable[[int, int], None] | None) -> None:
    """Append what is missing of a file."""
    done = partial.stat().st_size if partial.exists() else 0
    request = urllib.request.Request(address, headers={"Range": f"bytes={done}-"} if done else {})
    try:
        response = urllib.request.urlopen(request, timeout=TIMEOUT)
    except urllib.error.HTTPError as error:
        if error.code == 416 and done:  # nothing is missing
            return
        raise
    with response:
        resumed = response.status == 206
        done = done if resumed else 0
        total = done + int(response.headers.get("Content-Length", 0))
        with partial.open("ab" if resumed else "wb") as file:
            while chunk := response.read(CHUNK):
                file.write(chunk)
                done += len(chunk)
                if on_bytes is not None:
                    on_bytes(done, total)
            file.flush()
            os.fsync(file.fileno())
        if total and done < total:
            raise ConnectionError(f"the server closed the connection after {done} of {total} bytes")
