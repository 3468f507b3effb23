"""A process that gathers on demand, each time in a child that may be killed: POLICIES STORE_OF_THE_FIRST."""

import sys
from pathlib import Path

from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.robots import GO2
from kine2go_warp.rollouts.config import GatherConfig
from kine2go_warp.rollouts.gather import gather
from tests.conftest import ANYTHING_GOES
from tests.killing import serve

MOTIONS = ("dog_trot", "dog_trot_again")


def gather_all(store: str, seed: str) -> None:
    """Gather a few short rollouts of both motions; no two have a seed in common."""
    for number, motion in enumerate(MOTIONS):
        config = GatherConfig(trajectories=4, rows=24, warm_up=0.1, seed=2 * int(seed) + number, **ANYTHING_GOES)
        gather(PolicyFolder(POLICIES / motion), DatasetWriter(Path(store), GO2), config, "cpu")


if __name__ == "__main__":
    import torch

    torch.set_num_threads(1)
    POLICIES = Path(sys.argv[1])
    # The first gathering loads the simulator's kernels, which the children then have.
    gather_all(sys.argv[2], "0")
    serve(gather_all)
