"""Files and folders that appear whole or not at all."""

import contextlib
import fcntl
import glob
import hashlib
import json
import os
import platform
import shutil
import tempfile
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path


def temporary_sibling(path: Path) -> Path:
    """Return a temporary name beside ``path``; what killed processes of this machine left there is removed."""
    prefix, suffix = f".tmp-{platform.node()}-", f"-{path.name}"
    for leftover in path.parent.glob(f"{glob.escape(prefix)}*{glob.escape(suffix)}"):
        process = leftover.name.removeprefix(prefix).removesuffix(suffix)
        if process.isdigit() and not is_running(int(process)):
            if leftover.is_dir() and not leftover.is_symlink():
                shutil.rmtree(leftover, ignore_errors=True)
            else:
                leftover.unlink(missing_ok=True)
    return path.with_name(f"{prefix}{os.getpid()}{suffix}")


def is_running(process: int) -> bool:
    """Return whether a process of this machine exists."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def check_place(path: Path) -> None:
    """Check that something can be written to a path, before the long work whose result it is.

    Raises:
        OSError: a part of it is no folder, too long, or a link to itself, or nothing can be written there.
    """
    with contextlib.suppress(FileNotFoundError):
        path.lstat()
    folder = next(one for one in path.absolute().parents if one.exists())
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(folder)) from None


@contextlib.contextmanager
def atomic_file(path: Path) -> Iterator[Path]:
    """Yield a temporary sibling of ``path`` to write to; rename it to ``path`` if the block succeeds.

    The temporary name keeps the suffix of ``path``, since some writers append their own otherwise. If the block
    raises, the temporary file is removed and ``path`` stays as it was.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = temporary_sibling(path)
    try:
        yield temporary
        flush_to_disk(temporary)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def atomic_folder(path: Path) -> Iterator[Path]:
    """Yield a temporary sibling of ``path``, an empty folder; it takes the place of ``path`` if the block succeeds.

    If the block raises, the temporary folder is removed and ``path`` stays as it was.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = temporary_sibling(path)
    shutil.rmtree(temporary, ignore_errors=True)
    temporary.mkdir()
    try:
        yield temporary
        put_in_place(temporary, path)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def put_in_place(folder: Path, path: Path) -> None:
    """Give a finished folder the name ``path``, and remove what had it before."""
    flush_folder(folder)
    old = temporary_sibling(path)
    old = old.with_name(f"{old.name}-old")
    if path.exists():
        path.rename(old)
    folder.rename(path)
    shutil.rmtree(old, ignore_errors=True)


def remove_leftovers(folder: Path) -> None:
    """Remove temporary files that a killed process has left in a folder that nobody else writes to."""
    for path in folder.glob(".tmp-*"):
        path.unlink(missing_ok=True)


def flush_to_disk(path: Path) -> None:
    """Make the operating system write ``path`` to the disk, so that a rename cannot overtake the data."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def flush_folder(folder: Path) -> None:
    """Write every file below ``folder`` to the disk."""
    for path in folder.rglob("*"):
        if path.is_file():
            flush_to_disk(path)


def link_or_copy(source: str, target: str) -> None:
    """Give a file that nobody changes a second name, or copy it where the file system cannot."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)


def same_bytes(one: Path, other: Path) -> bool:
    """Return whether two files are both there and equal."""
    return one.is_file() and other.is_file() and one.read_bytes() == other.read_bytes()


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file as hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@contextlib.contextmanager
def locked(path: Path, wait: bool = False, shared: bool = False) -> Iterator[bool]:
    """Lock a file or folder until the block ends, or the process does; yield whether that succeeded.

    Args:
        path: What to lock; a file that is not there is created, and not removed.
        wait: Wait until no other process holds the lock, instead of yielding false.
        shared: Keep out those alone that want the lock for themselves. Nothing is created.
    """
    flags = os.O_RDONLY if shared or path.is_dir() else os.O_RDWR | os.O_CREAT
    descriptor = os.open(path, flags, 0o644)
    try:
        fcntl.flock(descriptor, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | (0 if wait else fcntl.LOCK_NB))
        succeeded = True
    except BlockingIOError:
        succeeded = False
    try:
        yield succeeded
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def held(lock: Path) -> Iterator[str]:
    """Lock a file until the block ends, or the process does; yield in words who else holds it, if anyone does."""
    with locked(lock) as is_ours:
        if is_ours:
            since = datetime.now(UTC).isoformat(timespec="seconds")
            lock.write_text(json.dumps({"process": os.getpid(), "machine": platform.node(), "since": since}))
        yield "" if is_ours else lock_holder(lock)


def lock_holder(lock: Path) -> str:
    """Return in words who holds a lock, or held it last."""
    try:
        holder = json.loads(lock.read_text())
        return f"process {holder['process']} on {holder['machine']}, since {holder['since']}"
    except (OSError, ValueError, KeyError, TypeError):
        return "it does not say which"


def moved_aside(path: Path, why: str) -> Path:
    """Rename a file or folder that is in the way to ``NAME.WHY-1``, or the next free number, and return that path."""
    number = 1
    while (aside := path.with_name(f"{path.name}.{why}-{number}")).exists():
        number += 1
    return path.rename(aside)
