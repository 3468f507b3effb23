"""The console script, and ``python -m kine2go_warp``; little is imported before an interruption is caught."""

import sys


def entry_point() -> None:
    """Run the command that the arguments name, and exit with its status."""
    try:
        from kine2go_warp.cli.main import entry_point as run
    except KeyboardInterrupt:
        sys.exit(130)
    run()


if __name__ == "__main__":
    entry_point()
