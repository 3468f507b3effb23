"""One of two processes that train together, as torchrun starts them: CLIP FOLDER and a PORT for each training."""

import contextlib
import os
import sys
from pathlib import Path

import torch

from kine2go_warp.interruption import TrainingInterrupted
from kine2go_warp.learning.presets import FAST
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.training import runner
from kine2go_warp.training.train import train
from tests.training.helpers import StopAfter

PRESET = FAST.override(
    {
        "env.num_worlds": 8,
        "ppo.iterations": 2,
        "ppo.num_steps_per_env": 6,
        "ppo.obs_normalization": True,
        "stopping.interval": 1,
        "stopping.rollouts": 2,
        "stopping.seconds": 0.2,
    }
)


class KeepingRunner(runner.ImitationRunner):
    """Writes what this process has learned beside the folder, where the first one alone writes a policy."""

    def train(self, *arguments):
        reason = super().train(*arguments)
        torch.save(self.alg.save(), self.folder.path.with_name(f"rank_{self.ranks.rank}.pt"))
        return reason


if __name__ == "__main__":
    torch.set_num_threads(1)
    runner.ImitationRunner = KeepingRunner
    clip, folder, ports = MotionClip.load(Path(sys.argv[1])), Path(sys.argv[2]), sys.argv[3:]
    # Only the first process decides: that the other one does not want to stop changes nothing.
    is_first = os.environ["RANK"] == "0"
    for name, port, stop in zip(("stopped", "stopped", "undisturbed"), ports, (is_first, False, False), strict=True):
        os.environ["MASTER_PORT"] = port
        with contextlib.suppress(TrainingInterrupted):
            train([clip], PRESET, folder / name, "cpu", should_stop=StopAfter(1) if stop else None)
