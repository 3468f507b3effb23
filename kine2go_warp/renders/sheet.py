"""A contact sheet: a trajectory in a few pictures, from its first row to its last."""

from pathlib import Path

import numpy as np
from PIL import Image

from kine2go_warp.dataset.motion import Motion
from kine2go_warp.files import atomic_file
from kine2go_warp.renders.captions import Picture, caption
from kine2go_warp.renders.process import RenderProcess
from kine2go_warp.renders.video import RenderedTrajectory, read_trajectories

WIDTH, HEIGHT = 320, 240
"""Of one picture [pixels]."""
COLUMNS, LINES = 4, 2


def draw_sheet(renderer: RenderProcess, motion: Motion, index: int, path: Path) -> Picture:
    """Write the contact sheet of a trajectory (.png) and return it, shape [height, width, 3].

    Args:
        renderer: Draws pictures of ``WIDTH`` x ``HEIGHT``.
        motion: The motion.
        index: Which of its trajectories.
        path: File to write.

    Raises:
        RenderError: there is no such trajectory, or its poses are not finite.
        DatasetError: the motion cannot be read.
    """
    (trajectory,) = read_trajectories(motion, [index])
    sheet = assemble(renderer, trajectory)
    with atomic_file(path) as temporary:
        Image.fromarray(sheet).save(temporary)
    return sheet


def assemble(renderer: RenderProcess, trajectory: RenderedTrajectory) -> Picture:
    """Return pictures of a trajectory at equal distances in time, line by line."""
    rows = np.linspace(0, len(trajectory.time) - 1, COLUMNS * LINES).round().astype(int)
    name = f"{trajectory.motion}/{trajectory.index}"
    pictures = [
        caption(renderer.draw(trajectory.request(int(row))), (name, f"{trajectory.time[row]:.2f} s")) for row in rows
    ]
    return np.asarray(pictures).reshape(LINES, COLUMNS, HEIGHT, WIDTH, 3).swapaxes(1, 2).reshape(
        LINES * HEIGHT, COLUMNS * WIDTH, 3
    )  # fmt: skip


def half_blocks(picture: Picture, columns: int) -> str:
    """Return a picture as text for a terminal of 24-bit colours: a character shows two pixels, one above the other."""
    lines = round(columns * picture.shape[0] / picture.shape[1] / 2.0)
    small = np.asarray(Image.fromarray(picture).resize((columns, 2 * lines), Image.Resampling.LANCZOS))
    texts = []
    for upper, lower in zip(small[::2], small[1::2], strict=True):
        cells = (
            "\x1b[38;2;{};{};{};48;2;{};{};{}m\u2580".format(*top, *bottom)
            for top, bottom in zip(upper, lower, strict=True)
        )
        texts.append("".join(cells) + "\x1b[0m")
    return "\n".join(texts)
