"""Pictures into a video: MP4 through FFmpeg's libraries, GIF through Pillow."""

from collections.abc import Iterable, Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.errors import RenderError

Picture = NDArray[np.uint8]

ENDINGS = (".mp4", ".gif")

QUALITY = 20
"""Constant rate factor of H.264: smaller is better and larger."""

GIF_COLOURS = 128


def check_ending(path: Path) -> None:
    """Check that a video can be written under this name.

    Raises:
        RenderError: the ending is unknown.
    """
    if path.suffix.lower() not in ENDINGS:
        raise RenderError(f"{path}: videos end in {' or '.join(ENDINGS)}, not '{path.suffix}'")


def possible_rate(path: Path, rate: float) -> float:
    """Return the rate nearest to ``rate`` that the format can have [Hz]: a GIF counts in hundredths of a second."""
    if path.suffix.lower() != ".gif":
        return rate
    return 100.0 / max(round(100.0 / rate), 2)


def write_video(pictures: Iterable[Picture], path: Path, rate: float) -> None:
    """Write a video; pictures are taken one at a time.

    Args:
        pictures: At least one, each of shape [height, width, 3].
        path: Its ending tells the format.
        rate: Pictures a second [Hz].
    """
    (write_gif if path.suffix.lower() == ".gif" else write_mp4)(iter(pictures), path, rate)


def write_mp4(pictures: Iterator[Picture], path: Path, rate: float) -> None:
    """Write H.264 that browsers and editors play; sides must be even."""
    import av

    first = next(pictures)
    with av.open(str(path), "w", format="mp4", options={"movflags": "faststart"}) as container:
        stream = container.add_stream("libx264", rate=Fraction(rate).limit_denominator(1001))
        stream.height, stream.width = first.shape[:2]
        stream.pix_fmt = "yuv420p"
        # Without mbtree=0 the same pictures may give another file: x264's look ahead depends on what is in its memory.
        stream.options = {"crf": str(QUALITY), "preset": "veryfast", "x264-params": "mbtree=0"}
        for picture in _chain(first, pictures):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")))
        container.mux(stream.encode())


def write_gif(pictures: Iterator[Picture], path: Path, rate: float) -> None:
    """Write an endless GIF; all pictures share the colours of the first, so that nothing flickers."""
    from PIL import Image

    first = Image.fromarray(next(pictures)).quantize(GIF_COLOURS, method=Image.Quantize.MEDIANCUT)
    others = (Image.fromarray(picture).quantize(palette=first, dither=Image.Dither.NONE) for picture in pictures)
    first.save(path, save_all=True, append_images=others, duration=round(1000.0 / rate), loop=0, optimize=False)


def _chain(first: Picture, others: Iterator[Picture]) -> Iterator[Picture]:
    yield first
    yield from others
