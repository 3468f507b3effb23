"""Draws pictures in a process of its own.

Mesa brings an LLVM library that it makes known to the whole process; when torch then loads Triton, which has another
one, the process crashes. Apart from each other both work, and a driver that fails takes nothing with it. A process
spawned by ``multiprocessing`` would import the caller's script again, and torch with it; this one imports only what
draws.
"""

import contextlib
import ctypes.util
import json
import math
import os
import subprocess
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.errors import Kine2GoError, RenderError
from kine2go_warp.renders import HELP
from kine2go_warp.renders.camera import Pose, View
from kine2go_warp.robots import DEFAULT_ROBOT, robot_named

Picture = NDArray[np.uint8]

LIBRARIES = {"egl": "EGL", "osmesa": "OSMesa"}
"""Ways to draw without a display, and the library that each needs."""

PATIENCE = 5.0
"""How long the process may take to end [s]."""


@dataclass(frozen=True)
class RenderRequest:
    """One picture to draw."""

    robot: Pose
    reference: Pose
    view: View
    show_reference: bool = True
    show_floor: bool = True

    def as_line(self) -> bytes:
        """Return the request as a line of JSON."""
        return json.dumps(asdict(self), default=lambda value: value.tolist()).encode() + b"\n"

    @classmethod
    def from_line(cls, line: bytes) -> "RenderRequest":
        """Undo ``as_line``."""
        content = json.loads(line)
        robot, reference = (
            Pose(**{name: np.array(values) for name, values in content.pop(key).items()})
            for key in ("robot", "reference")
        )
        view = content.pop("view")
        return cls(robot, reference, View(**view | {"target": np.array(view["target"])}), **content)


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


class RenderProcess:
    """Draws pictures of one size. Use it as a context manager."""

    def __init__(self, width: int, height: int, robot: str = DEFAULT_ROBOT, meshes: Path | None = None) -> None:
        """Start the process; sizes in pixels, ``robot`` as in ``robots.robot_named``, ``meshes`` as in ``Scene``.

        Raises:
            RenderError: this machine cannot draw.
        """
        library = drawing_library()
        self._shape = (height, width, 3)
        # In a session of its own, so that Ctrl-C reaches this process only, which then ends the other one.
        what = [str(width), str(height), robot, *([] if meshes is None else [str(meshes)])]
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "kine2go_warp.renders.process", library, *what],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
            env={**os.environ, "MUJOCO_GL": library, "PYOPENGL_PLATFORM": library},
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._requests, self._answers = self._process.stdin, self._process.stdout
        try:
            line = self._answers.readline()
        except BaseException:
            self.close()
            raise
        error = json.loads(line) if line else f"cannot draw with {library}, its driver failed; {HELP}"
        if error is not None:
            self.close()
            raise RenderError(error)

    def __enter__(self) -> "RenderProcess":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the process."""
        for pipe in (self._requests, self._answers):
            with contextlib.suppress(OSError):
                pipe.close()
        try:
            self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def draw(self, request: RenderRequest) -> Picture:
        """Return a picture, shape [height, width, 3].

        Raises:
            RenderError: the process has ended.
        """
        picture, size = b"", math.prod(self._shape)
        with contextlib.suppress(BrokenPipeError):
            self._requests.write(request.as_line())
            self._requests.flush()
            picture = self._answers.read(size)
        if len(picture) < size:
            raise RenderError(f"the process that draws has ended, perhaps by a fault of the graphics driver; {HELP}")
        return np.frombuffer(bytearray(picture), np.uint8).reshape(self._shape)


def serve(library: str, size: tuple[int, int], what: list[str], requests: BinaryIO, answers: BinaryIO) -> None:
    """Draw a picture for each request, a line of JSON, until the requests end.

    The first answer is a line of JSON, null or an error message; the others are the bytes of pictures. ``what`` is the
    robot and, if there is one, the folder of meshes.
    """
    from kine2go_warp.renders.renderer import OffscreenRenderer
    from kine2go_warp.renders.scene import Scene

    def answer(content: bytes) -> None:
        answers.write(content)
        answers.flush()

    try:
        scene = Scene(robot_named(what[0]), *(Path(folder) for folder in what[1:]))
        with OffscreenRenderer(scene, *size, library) as renderer:
            answer(b"null\n")
            for line in requests:
                request = RenderRequest.from_line(line)
                renderer.scene.place(request.robot, request.reference)
                answer(renderer.draw(request.view, request.show_reference, request.show_floor).tobytes())
    except Kine2GoError as error:
        answer(json.dumps(str(error)).encode() + b"\n")
    except BrokenPipeError:
        os._exit(0)  # the caller has gone


if __name__ == "__main__":
    # Drivers may print; what they say must not get among the pictures.
    picture_pipe = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    serve(sys.argv[1], (int(sys.argv[2]), int(sys.argv[3])), sys.argv[4:], sys.stdin.buffer, picture_pipe)
