"""Draws pictures in a process of its own.

Mesa brings an LLVM library that it makes known to the whole process; when torch then loads Triton, which has another
one, the process crashes. Apart from each other both work, and a driver that fails takes nothing with it.
"""

import contextlib
import ctypes.util
import os
import subprocess
import sys

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.errors import RenderError
from kine2go_warp.renders.order import Order

Picture = NDArray[np.uint8]

LIBRARIES = {"egl": "EGL", "osmesa": "OSMesa"}
"""Ways to draw without a display, and the library that each needs."""

HELP = "on Debian and Ubuntu install libegl1 and libgl1-mesa-dri, or libosmesa6 and set MUJOCO_GL=osmesa"

PATIENCE = 5.0
"""How long the process may take to end [s]."""


def drawing_library() -> str:
    """Return how to draw without a display: ``egl`` or ``osmesa``. The environment variable MUJOCO_GL decides.

    Raises:
        RenderError: neither is there, or MUJOCO_GL names something else.
    """
    asked = os.environ.get("MUJOCO_GL", "").lower()
    if asked and asked not in LIBRARIES:
        raise RenderError(f"MUJOCO_GL is '{asked}', which needs a display or draws nothing; set it to egl or osmesa")
    for name in [asked] if asked else LIBRARIES:
        if ctypes.util.find_library(LIBRARIES[name]) is not None:
            return name
    missing = LIBRARIES[asked] if asked else " or ".join(LIBRARIES.values())
    raise RenderError(f"no OpenGL library ({missing}) to draw with; {HELP}")


class Artist:
    """Draws pictures of one size. Use it as a context manager."""

    def __init__(self, width: int, height: int) -> None:
        """Start the process; sizes in pixels.

        Raises:
            RenderError: this machine cannot draw.
        """
        self.width, self.height = width, height
        library = drawing_library()
        command = [sys.executable, "-P", "-m", "kine2go_warp.renders.worker", library, str(width), str(height)]
        # In a session of its own, so that Ctrl-C reaches this process only, which then ends the other one.
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
            env={**os.environ, "MUJOCO_GL": library, "PYOPENGL_PLATFORM": library},
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._orders, self._answers = self._process.stdin, self._process.stdout
        try:
            said = self._answers.readline().decode().strip()
        except BaseException:
            self.close()
            raise
        if said != "ready":
            self.close()
            raise RenderError(said or f"cannot draw with {library}, its driver failed; {HELP}")

    def __enter__(self) -> "Artist":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the process."""
        for pipe in (self._orders, self._answers):
            with contextlib.suppress(OSError):
                pipe.close()
        try:
            self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def draw(self, order: Order) -> Picture:
        """Return a picture, shape [height, width, 3].

        Raises:
            RenderError: the process has ended.
        """
        size = self.height * self.width * 3
        try:
            self._orders.write(order.to_bytes())
            self._orders.flush()
            pixels = self._answers.read(size)
        except BrokenPipeError:
            pixels = b""
        if len(pixels) != size:
            raise RenderError(f"the process that draws has ended, perhaps by a fault of the graphics driver; {HELP}")
        return np.frombuffer(pixels, np.uint8).reshape(self.height, self.width, 3)
