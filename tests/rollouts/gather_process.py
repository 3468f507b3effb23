"""A process that gathers on demand, each time in a child that may be killed.

Python and the simulator start once. A line with a store and a seed on its standard input forks a child that gathers two
motions into that store; the child's number, and how it ended, are printed.
"""

import os
import sys
import time
from pathlib import Path

from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.robots import GO2
from kine2go_warp.rollouts.config import GatherConfig
from kine2go_warp.rollouts.gather import gather
from tests.conftest import ANYTHING_GOES

MOTIONS = ("dog_trot", "dog_trot_again")


def gather_all(policies: Path, store: Path, seed: int) -> None:
    """Gather a few short rollouts of both motions; no two have a seed in common."""
    for number, motion in enumerate(MOTIONS):
        config = GatherConfig(trajectories=4, rows=24, warm_up=0.1, seed=2 * seed + number, **ANYTHING_GOES)
        gather(PolicyFolder(policies / motion), DatasetWriter(store, GO2), config, "cpu")


def serve(policies: Path) -> None:
    """Gather whatever is asked for."""
    for line in sys.stdin:
        store, seed = line.split()
        child = os.fork()
        if not child:
            gather_all(policies, Path(store), int(seed))
            os._exit(0)
        print(child, flush=True)
        started = time.perf_counter()
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        print(status, time.perf_counter() - started, flush=True)


if __name__ == "__main__":
    import torch

    torch.set_num_threads(1)
    # The first gathering loads the simulator's kernels, which the children then have.
    gather_all(Path(sys.argv[1]), Path(sys.argv[2]), 0)
    print("ready", flush=True)
    serve(Path(sys.argv[1]))
