"""A process that trains on demand, each time in a child that may be killed: CLIP FOLDER_OF_THE_FIRST."""

import sys
from pathlib import Path

from kine2go_warp.learning.presets import FAST
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.training.train import train
from tests.killing import serve

TINY = FAST.override({"env.num_worlds": 16, "ppo.iterations": 6, "ppo.save_interval": 1})


def train_in(folder: str) -> None:
    """Train a policy."""
    train([CLIP], TINY, Path(folder), "cpu", processes=1)


if __name__ == "__main__":
    import torch

    torch.set_num_threads(1)
    CLIP = MotionClip.load(Path(sys.argv[1]))
    # The first training loads the simulator's kernels, which the children then have.
    train_in(sys.argv[2])
    serve(train_in)
