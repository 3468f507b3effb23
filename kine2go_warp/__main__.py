"""``python -m kine2go_warp`` is the command ``kine2go``."""

from kine2go_warp.cli.main import entry_point

if __name__ == "__main__":
    entry_point()
