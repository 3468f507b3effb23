"""A process that trains on demand, each time in a child that may be killed.

Python and the simulator start once. A line with a folder on its standard input forks a child that trains a policy
there; the child's number, and how it ended, are printed.
"""

import os
import sys
import time
from dataclasses import replace
from pathlib import Path

from kine2go_warp.learning.config import TrainConfig
from kine2go_warp.learning.presets import FAST, PRESETS
from kine2go_warp.learning.train import train
from kine2go_warp.motions.clip import MotionClip

TINY = TrainConfig(num_worlds=16, iterations=6)

PRESETS["fast"] = replace(FAST, ppo=replace(FAST.ppo, save_interval=1))


def serve(clip: MotionClip) -> None:
    """Train wherever asked to."""
    for line in sys.stdin:
        child = os.fork()
        if not child:
            train([clip], TINY, Path(line.strip()), "cpu", processes=1)
            os._exit(0)
        print(child, flush=True)
        started = time.perf_counter()
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        print(status, time.perf_counter() - started, flush=True)


if __name__ == "__main__":
    import torch

    torch.set_num_threads(1)
    ours = MotionClip.load(Path(sys.argv[1]))
    # The first training loads the simulator's kernels, which the children then have.
    train([ours], TINY, Path(sys.argv[2]), "cpu", processes=1)
    print("ready", flush=True)
    serve(ours)
