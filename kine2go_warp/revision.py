"""Which revision of this software is running."""

import subprocess
from functools import cache
from pathlib import Path


@cache
def revision() -> str:
    """Return the git commit of the checkout that this package is in, empty where it is in none.

    A plus sign marks a checkout with changes that are not committed.
    """
    folder = Path(__file__).parent.parent
    if not (folder / ".git").exists():
        return ""

    def git(*arguments: str) -> str:
        result = subprocess.run(["git", "-C", folder, *arguments], capture_output=True, text=True, check=True)
        return result.stdout.strip()

    try:
        return git("rev-parse", "HEAD") + ("+" if git("status", "--porcelain", "--untracked-files=no") else "")
    except (OSError, subprocess.CalledProcessError):
        return ""
