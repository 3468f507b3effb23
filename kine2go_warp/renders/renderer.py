"""Pixels of a scene, drawn by MuJoCo into memory: on a GPU through EGL, without one by Mesa in software."""

from types import TracebackType
from typing import Any

import mujoco as mujoco_package
import numpy as np
from numpy.typing import NDArray

from kine2go_warp.errors import RenderError
from kine2go_warp.renders import HELP
from kine2go_warp.renders.camera import View
from kine2go_warp.renders.scene import ROBOT_GROUP, Scene, shown_shapes

mujoco: Any = mujoco_package  # its module is compiled: type checkers do not know what is in it

Picture = NDArray[np.uint8]

MOST_SHAPES = 200
FIELD_OF_VIEW = 40.0
"""Angle from the lower to the upper edge of a picture [deg]."""


def open_context(library: str, width: int, height: int) -> Any:
    """Return an OpenGL context that needs no display, by ``egl`` or ``osmesa``.

    Raises:
        RenderError: this machine has none.
    """
    try:
        if library == "egl":
            from mujoco.egl import GLContext
        else:
            from mujoco.osmesa import GLContext
        context = GLContext(width, height)
        context.make_current()
    except Exception as error:  # noqa: BLE001 - drivers fail in many ways
        raise RenderError(f"cannot draw with {library} ({error.__class__.__name__}); {HELP}") from None
    return context


class OffscreenRenderer:
    """Draws a scene. Use it as a context manager."""

    def __init__(self, scene: Scene, width: int, height: int, library: str) -> None:
        """Open a context.

        Args:
            scene: What is drawn.
            width: Of a picture [pixels].
            height: Of a picture [pixels].
            library: ``egl`` or ``osmesa``.

        Raises:
            RenderError: this machine cannot draw.
        """
        self.scene, self.width, self.height = scene, width, height
        scene.model.vis.global_.fovy = FIELD_OF_VIEW
        scene.model.vis.global_.offwidth, scene.model.vis.global_.offheight = width, height
        self._viewport = mujoco.MjrRect(0, 0, width, height)
        self._shapes = mujoco.MjvScene(scene.model, MOST_SHAPES)
        self._option, self._camera = mujoco.MjvOption(), mujoco.MjvCamera()
        self._context = open_context(library, width, height)
        try:
            self._buffers = mujoco.MjrContext(scene.model, mujoco.mjtFontScale.mjFONTSCALE_100)
            mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._buffers)
        except Exception as error:  # noqa: BLE001 - drivers fail in many ways
            self._context.free()
            raise RenderError(f"cannot draw {width}x{height} pixels here ({error}); choose a smaller size") from None

    def __enter__(self) -> "OffscreenRenderer":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._context.make_current()
        self._buffers.free()
        self._context.free()

    def draw(self, view: View, reference: bool = True, floor: bool = True) -> Picture:
        """Return a picture of the scene as it is posed, shape [height, width, 3]."""
        self._context.make_current()  # another canvas may have been opened or closed since
        camera = self._camera
        camera.lookat[:] = view.target
        camera.distance, camera.azimuth, camera.elevation = view.distance, view.azimuth, view.elevation
        self._option.geomgroup[:] = shown_shapes(reference, floor)
        model, data = self.scene.model, self.scene.data
        category = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(model, data, self._option, None, camera, category, self._shapes)
        self._shapes.flags[mujoco.mjtRndFlag.mjRND_HAZE] = 1
        # Of MuJoCo's categories, decoration alone casts no shadow: not the reference, and not the floor upon itself.
        for shape in self._shapes.geoms[: self._shapes.ngeom]:
            if model.geom_group[shape.objid] != ROBOT_GROUP:
                shape.category = mujoco.mjtCatBit.mjCAT_DECOR
        mujoco.mjr_render(self._viewport, self._shapes, self._buffers)
        picture = np.empty((self.height, self.width, 3), np.uint8)
        mujoco.mjr_readPixels(picture, None, self._viewport, self._buffers)
        return picture[::-1]
