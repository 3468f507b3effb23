"""Compiles all that a control step launches for a GPU, and prints how many modules: CLIP FOLDER ARCHITECTURE."""

import sys
from dataclasses import replace
from pathlib import Path

import kine2go_warp.kernels  # noqa: F401 - its settings of Warp come first

# isort: split
import warp as wp

from kine2go_warp.device import start_warp
from kine2go_warp.env.config import TerrainConfig
from kine2go_warp.learning.presets import FAST, PAPER, ROBUST
from kine2go_warp.motions.clip import MotionClip
from tests.env.launching import eager, watched


def main(clip: Path, folder: Path, architecture: int) -> None:
    """Step the presets and a hilly ground on the CPU, and compile each module with its blocks for a GPU."""
    start_warp()
    hilly = replace(FAST.env, terrain=TerrainConfig("waves"))
    found = set()
    for config in (FAST.env, ROBUST.env, PAPER.env, hilly):
        environment = eager([MotionClip.load(clip)], replace(config, num_worlds=2))
        with watched() as seen:
            environment.step()
        found |= seen.kernels
    for number, (module, block_dim) in enumerate(sorted(found, key=lambda one: (one[0].name, one[1]))):
        wp.set_module_options({"block_dim": block_dim}, module=module)
        wp.compile_aot_module(module, arch=architecture, module_dir=folder / str(number), use_ptx=False)
    print(len(found))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]))
