"""Reading text tables of numbers, with errors that name the line."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.keypoints import MINIMUM_FRAMES


def read_lines(path: Path) -> list[str]:
    """Return the lines of a text file, without empty ones at its end.

    Raises:
        ClipError: there is no such file, it is not text, or it has too few lines for a motion.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ClipError(f"{path}: no such motion file") from None
    except IsADirectoryError:
        raise ClipError(f"{path}: is a folder, not a motion file") from None
    except UnicodeDecodeError:
        raise ClipError(f"{path}: not a text file") from None
    except OSError as error:
        raise ClipError(f"{path}: cannot be read ({error.strerror})") from None
    lines = text.rstrip().splitlines()
    if len(lines) < MINIMUM_FRAMES:
        raise ClipError(f"{path}: {len(lines)} line(s); a motion needs at least {MINIMUM_FRAMES} frames")
    return lines


def parse_numbers(
    path: Path, lines: list[str], num_columns: int, largest: float, first_line: int = 1
) -> NDArray[np.float64]:
    """Parse lines of comma-separated finite numbers.

    Args:
        path: The file, for messages.
        lines: Its lines of numbers.
        num_columns: Numbers in each line.
        largest: Magnitude beyond which a number cannot be meant.
        first_line: Number of the first of these lines in the file.

    Returns:
        The numbers, shape [num_lines, num_columns].

    Raises:
        ClipError: a line has another width, or holds something that is not a number within the limit.
    """
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
        if not np.all(np.abs(rows[index]) <= largest):
            raise ClipError(f"{where}: a value is not finite or its magnitude exceeds {largest:g}")
    return rows
