"""Where the source clips are."""

import os
from pathlib import Path

from kine2go_warp.errors import CatalogueError

DATA_VARIABLE = "KINE2GO_DATA"


def data_folder(given: Path | None) -> Path | None:
    """Return the folder of the source clips: the one given, or that of the environment variable.

    Raises:
        CatalogueError: it does not exist.
    """
    folder = given or (Path(os.environ[DATA_VARIABLE]) if os.environ.get(DATA_VARIABLE) else None)
    if folder is not None and not folder.is_dir():
        raise CatalogueError(f"{folder}: no such folder of source clips")
    return folder
