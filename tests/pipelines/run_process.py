"""A process that runs a short recipe on demand, each time in a child that may be killed: DATA FOLDER_OF_THE_FIRST."""

import sys
from dataclasses import replace
from pathlib import Path

from tests.killing import serve
from tests.pipelines.helpers import TWO, run

SHORT = replace(TWO, train=TWO.train.override({"ppo.iterations": 3}))


def run_in(folder: str) -> int:
    """Run the recipe; returns how many motions failed."""
    result, _ = run(SHORT, Path(folder), DATA)
    return len(result.failed)


if __name__ == "__main__":
    import torch

    torch.set_num_threads(1)
    DATA = Path(sys.argv[1])
    # The first run loads the simulator's kernels, which the children then have.
    run_in(sys.argv[2])
    serve(run_in)
