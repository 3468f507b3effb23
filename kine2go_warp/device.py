"""Which device to use, chosen once for Warp and torch."""

import contextlib
import os
import sys
import threading
from collections.abc import Callable, Iterator

from kine2go_warp.errors import Kine2GoError

LEAST_WORLDS = 32
"""Fewer worlds are not worth a process."""

CACHE_HINT = (
    "Warp keeps compiled kernels here and cannot write; name another folder in the environment variable WARP_CACHE_PATH"
)


def choose_device(name: str | None) -> str:
    """Return the device to use: the one named, or CUDA where there is one, else the CPU.

    Raises:
        Kine2GoError: the named device does not exist here.
    """
    import warp as wp

    start_warp()
    known = [device.alias for device in wp.get_devices()]
    too_old = driver_too_old()
    if name is None:
        if too_old:
            print_note(f"{too_old}; using the CPU")
        return "cuda:0" if wp.is_cuda_available() else "cpu"
    name = "cuda:0" if name == "cuda" else name
    if name not in known:
        raise Kine2GoError(
            f"no device '{name}' on this machine; there is: {', '.join(known)}" + (too_old and f"; {too_old}")
        )
    return name


def is_here(name: str) -> bool:
    """Return whether this machine has a device."""
    import warp as wp

    start_warp()
    return name in [device.alias for device in wp.get_devices()]


def driver_too_old() -> str:
    """Return in a sentence that this machine's NVIDIA driver is older than Warp needs; empty if it is not."""
    import warp as wp

    driver, toolkit = wp.get_cuda_driver_version(), wp.get_cuda_toolkit_version()
    # Any driver of the toolkit's major version will do.
    if driver is None or toolkit is None or driver >= (toolkit[0], 0):
        return ""
    return (
        f"the NVIDIA driver supports CUDA {driver[0]}.{driver[1]}, and the installed Warp needs {toolkit[0]}.0: "
        "update the driver, or install a Warp that was built with an older CUDA"
    )


def is_out_of_memory(error: Exception) -> bool:
    """Return whether torch, Warp or Python says that memory is used up; torch and Warp have no error in common."""
    kinds = ("OutOfMemoryError", "MemoryError")
    return error.__class__.__name__ in kinds or str(error).startswith("Failed to allocate")


@contextlib.contextmanager
def fitting(num_worlds: int, device: str) -> Iterator[None]:
    """Say how many worlds to try where a batch does not fit into the memory.

    Raises:
        Kine2GoError: the block has run out of memory.
    """
    try:
        yield
    except (RuntimeError, MemoryError) as error:
        if not is_out_of_memory(error):
            raise
        fewer = f"try {num_worlds // 2}" if num_worlds > 1 else "free some"
        raise Kine2GoError(f"{num_worlds} world(s) do not fit into the memory of {device}; {fewer}") from None


def choose_processes(wanted: int | None, num_worlds: int, device: str) -> int:
    """Return how many processes to simulate in: those wanted, or one a core on a CPU, one on a GPU.

    Raises:
        Kine2GoError: fewer than one are wanted.
    """
    if wanted is not None and wanted < 1:
        raise Kine2GoError(f"processes is {wanted}; it must be at least 1")
    if wanted is not None:
        return max(1, min(wanted, num_worlds))
    if device != "cpu":
        return 1
    return max(1, min(len(os.sched_getaffinity(0)), num_worlds // LEAST_WORLDS))


def print_note(message: str) -> None:
    """Print what a user should know to standard error."""
    print(f"kine2go: {message}", file=sys.stderr, flush=True)


@contextlib.contextmanager
def compilation_notice(on_note: Callable[[str], None] = print_note, after: float = 5.0) -> Iterator[None]:
    """Say that kernels are compiled if the block takes longer than ``after`` seconds, as it does the first time."""
    message = "compiling the simulation's kernels; this takes minutes the first time, and seconds afterwards"
    timer = threading.Timer(after, on_note, [message])
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def start_warp() -> None:
    """Start Warp without its messages, since the command line reports what matters itself.

    Raises:
        Kine2GoError: its kernel cache cannot be written.
    """
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR
    try:
        with silent_standard_error():
            wp.init()
    except OSError as error:
        raise Kine2GoError(f"{error.filename}: {CACHE_HINT}") from None
    folder = str(wp.config.kernel_cache_dir)
    if not os.access(folder, os.W_OK | os.X_OK):
        raise Kine2GoError(f"{folder}: {CACHE_HINT}")


@contextlib.contextmanager
def silent_standard_error() -> Iterator[None]:
    """Drop what compiled code writes to standard error: Warp's native part warns there if there is no CUDA driver."""
    kept = os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)
