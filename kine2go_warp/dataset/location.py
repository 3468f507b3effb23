"""Where a dataset lies: a folder, or an address of a server that fsspec reads (https, s3, hf, ...)."""

import json
import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import zarr

from kine2go_warp.errors import DatasetError, MissingExtraError

ADDRESS = re.compile(r"([a-z][a-z0-9+.-]+):/+")
"""Beginning of an address; a ``Path`` of one has lost a slash."""

SILENCE = 30.0
"""For so long a web server may send nothing before it is given up [s]."""


@dataclass(frozen=True)
class RemotePath:
    """A file or folder on a server, with the methods of ``Path`` by which a dataset is read."""

    url: str

    def __truediv__(self, name: str) -> "RemotePath":
        return RemotePath(f"{self.url}/{name}")

    def __str__(self) -> str:
        return self.url

    @property
    def name(self) -> str:
        """Last part of the address."""
        return self.url.rsplit("/", 1)[-1]

    def resolve(self) -> "RemotePath":
        """Return the address itself."""
        return self

    def read_bytes(self) -> bytes:
        """Return the content of a file.

        Raises:
            FileNotFoundError: the server has no such file.
            DatasetError: the server cannot be reached, or broke the transfer off.
        """
        return self._fetched(lambda system: system.cat_file(self.url))

    def read_text(self, encoding: str = "utf-8") -> str:
        """Return the text of a file; errors are those of ``read_bytes``."""
        return self.read_bytes().decode(encoding)

    def is_file(self) -> bool:
        """Return whether the server has such a file.

        Raises:
            DatasetError: the server cannot be reached.
        """
        try:
            self.read_bytes()
        except FileNotFoundError:
            return False
        return True

    def check_ranges(self) -> None:
        """Check that the server sends parts of a file, as reading shards needs.

        Raises:
            DatasetError: it does not.
        """
        if len(self._fetched(lambda system: system.cat_file(self.url, start=1, end=2))) != 1:
            raise DatasetError(
                f"{self.url}: this server sends whole files only (no HTTP ranges), by which a dataset cannot be read; "
                "copy the dataset here, or use another server"
            )

    @cached_property
    def options(self) -> dict[str, Any]:
        """Options of fsspec for the kind of server."""
        if not self.url.startswith("http"):
            return {}
        import aiohttp

        return {
            "client_kwargs": {"timeout": aiohttp.ClientTimeout(total=None, sock_connect=SILENCE, sock_read=SILENCE)}
        }

    def _fetched(self, fetch: Any) -> bytes:
        try:
            import fsspec

            return fetch(fsspec.filesystem(self.url.partition(":")[0], **self.options))
        except FileNotFoundError:
            raise
        except ImportError as error:
            raise MissingExtraError(
                f"{self.url}: reading from there needs the extra 'remote', pip install 'kine2go-warp[remote]', "
                f"and for S3 the package s3fs ({error})"
            ) from None
        except Exception as error:  # noqa: BLE001 - each kind of server has errors of its own
            raise DatasetError(f"{self.url}: cannot be read ({described(error)})") from None


def described(error: Exception) -> str:
    """Return what kind of error it is, and its text in one line where it has one."""
    text = " ".join(str(error).split())
    return f"{error.__class__.__name__}: {text[:160]}" if text else error.__class__.__name__


def located(path: Path | str) -> Path:
    """Return where a dataset lies.

    An address becomes a ``RemotePath``, which has those methods of ``Path`` that reading uses; what writes, checks or
    reviews a dataset needs a folder.
    """
    if isinstance(path, RemotePath):
        return cast("Path", path)
    match = ADDRESS.match(str(path))
    if match is None:
        return Path(path)
    address = f"{match[1]}://{str(path)[match.end() :]}".rstrip("/")
    return cast("Path", RemotePath(address))


def is_remote(path: Path) -> bool:
    """Return whether a dataset lies on a server."""
    return isinstance(path, RemotePath)


def open_group(path: Path) -> zarr.Group:
    """Open a group of a store to read, in a folder or on a server."""
    if not isinstance(path, RemotePath):
        return zarr.open_group(path, mode="r")
    from zarr.storage import FsspecStore

    return zarr.open_group(FsspecStore.from_url(path.url, storage_options=path.options, read_only=True), mode="r")


def root_attributes(path: Path) -> dict[str, Any]:
    """Return the attributes of a group from its own file; an index of arrays in it is not looked at.

    Raises:
        OSError: the file cannot be read.
        ValueError: it is no JSON of a group.
    """
    content = json.loads((path / "zarr.json").read_text(encoding="utf-8"))
    if not isinstance(content, dict) or content.get("node_type") != "group":
        raise ValueError("no group of Zarr 3")
    return dict(content.get("attributes", {}))
