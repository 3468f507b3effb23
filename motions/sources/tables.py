"""Reading text tables of numbers, with errors that name the line."""

import codecs
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.keypoints import MINIMUM_FRAMES
from kine2go_warp.tables import counted

FORMATS = (
    (r"\s*HIERARCHY\b", "a BVH file"),
    (r"\s*\{[^{}]*\"(Frames|FrameDuration|LoopMode)\"", "a joint-space motion file (JSON with Frames)"),
    (r"\s*[\[{]", "a JSON file"),
    (r"\s*<\?xml", "an XML file"),
)
"""What files of other formats begin with."""


def read_bytes(path: Path) -> bytes:
    """Return what is in a file.

    Raises:
        ClipError: there is no such file, or it cannot be read.
    """
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise ClipError(f"{path}: no such motion file") from None
    except IsADirectoryError:
        raise ClipError(f"{path}: is a folder, not a motion file") from None
    except OSError as error:
        raise ClipError(f"{path}: cannot be read ({error.strerror})") from None


def read_text(path: Path) -> str:
    """Return the text of a file: UTF-8 with or without a byte order mark, or UTF-16.

    Raises:
        ClipError: there is no such file, or it is not text.
    """
    content = read_bytes(path)
    is_wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        text = content.decode("utf-16" if is_wide else "utf-8-sig")
    except UnicodeDecodeError:
        raise ClipError(f"{path}: not a text file") from None
    if is_wide and not text.isascii():
        raise ClipError(f"{path}: not a text file")
    return text


def read_lines(path: Path) -> list[str]:
    """Return the lines of a text file, without empty ones at its end.

    Where semicolons part the fields, as spreadsheets write them beside decimal commas, they become commas and points.

    Raises:
        ClipError: there is no such file, it is not text, it has too few lines for a motion, or is in a format that
            another source reads.
    """
    text = read_text(path)
    for beginning, kind in FORMATS:
        if re.match(beginning, text):
            raise ClipError(
                f"{path}: {kind}, which this source does not read; docs/adding-a-source.md says how to add one"
            )
    lines = text.rstrip().splitlines()
    if lines and lines[0].count(";") >= 2:
        lines = [line.replace(",", ".").replace(";", ",") for line in lines]
    if len(lines) < MINIMUM_FRAMES:
        raise ClipError(f"{path}: {counted(len(lines), 'line')}; a motion needs at least {MINIMUM_FRAMES} frames")
    return lines


def parse_numbers(
    path: Path, lines: list[str], num_columns: int, largest: float, first_line: int = 1, names: Sequence[str] = ()
) -> NDArray[np.float64]:
    """Parse lines of comma-separated finite numbers.

    Args:
        path: The file, for messages.
        lines: Its lines of numbers.
        num_columns: Numbers in each line.
        largest: Magnitude beyond which a number cannot be meant.
        first_line: Number of the first of these lines in the file.
        names: Of the columns, for messages.

    Returns:
        The numbers, shape [num_lines, num_columns].

    Raises:
        ClipError: a line has another width, or holds something that is not a number within the limit.
    """
    plain = (line.rstrip().rstrip(",") for line in lines)
    try:
        rows = np.loadtxt(plain, delimiter=",", comments=None, ndmin=2)
    except ValueError:
        rows = np.empty((0, 0))
    if rows.shape == (len(lines), num_columns) and np.all(np.abs(rows) <= largest):
        return rows
    # Something is unusual: line by line, to say where.
    rows = np.empty((len(lines), num_columns))
    for index, line in enumerate(lines):
        where = f"{path}, line {index + first_line}"
        fields = line.rstrip().rstrip(",").split(",")
        if len(fields) != num_columns:
            raise ClipError(f"{where}: {len(fields)} columns instead of {num_columns}")
        try:
            rows[index] = [float(field) for field in fields]
        except ValueError as error:
            raise ClipError(f"{where}: not a number ({error})") from None
        wrong = ~(np.abs(rows[index]) <= largest)
        if wrong.any():
            column = int(np.argmax(wrong))
            name = f" ({names[column]})" if names else ""
            raise ClipError(
                f"{where}: column {column + 1}{name}, a value is not finite or its magnitude exceeds {largest:g}"
            )
    return rows


def is_number(text: str) -> bool:
    """Return whether a text is a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True
