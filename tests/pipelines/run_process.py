"""A process that runs a recipe on demand, each time in a child that may be killed.

Python and the simulator start once. A line with a folder on its standard input forks a child that runs a short recipe
there; the child's number, and how it ended, are printed.
"""

import os
import sys
import time
from dataclasses import replace
from pathlib import Path

from tests.pipelines.helpers import TWO, run

SHORT = replace(TWO, train=replace(TWO.train, iterations=3))


def serve(data: Path) -> None:
    """Run the recipe in whatever folder is asked for."""
    for line in sys.stdin:
        child = os.fork()
        if not child:
            result, _ = run(SHORT, Path(line.strip()), data)
            os._exit(len(result.failed))
        print(child, flush=True)
        started = time.perf_counter()
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        print(status, time.perf_counter() - started, flush=True)


if __name__ == "__main__":
    import torch

    torch.set_num_threads(1)
    # The first run loads the simulator's kernels, which the children then have.
    run(SHORT, Path(sys.argv[2]), Path(sys.argv[1]))
    print("ready", flush=True)
    serve(Path(sys.argv[1]))
