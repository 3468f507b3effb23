"""Text that is burnt into pictures."""

from functools import cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

Picture = NDArray[np.uint8]

INK, PAPER = (38, 43, 51), (255, 255, 255, 185)


@cache
def font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Return the font that comes with Pillow, so that pictures are the same on every machine."""
    return ImageFont.load_default(size)


def caption(picture: Picture, lines: tuple[str, str]) -> Picture:
    """Return a picture with one text at its upper left and one at its lower left, on paper that shines through.

    Texts that are too wide get smaller.
    """
    height, width = picture.shape[:2]
    image = Image.fromarray(picture)
    brush = ImageDraw.Draw(image, "RGBA")
    size = max(round(0.042 * height), 9)
    margin = max(round(0.4 * size), 3)
    for text, at_top in zip(lines, (True, False), strict=True):
        fitting = next(
            (one for one in range(size, 7, -1) if brush.textlength(text, font=font(one)) <= width - 4 * margin), 7
        )
        left, top, right, bottom = brush.textbbox((0, 0), "Hg" + text, font=font(fitting))
        right = left + brush.textlength(text, font=font(fitting))
        y = margin if at_top else height - 3 * margin - (bottom - top)
        box = (margin, y, 3 * margin + right - left, y + 2 * margin + bottom - top)
        brush.rounded_rectangle(box, radius=margin, fill=PAPER)
        brush.text((2 * margin - left, y + margin - top), text, font=font(fitting), fill=INK)
    return np.asarray(image)
