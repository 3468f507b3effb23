"""Warp kernels and functions: one quantity each, pure, the same code on CPU and CUDA.

Inside kernels quaternions are ``wp.quat`` (x, y, z, w), as in Newton. Frame suffixes: ``_w`` world, ``_b`` base,
``_h`` heading (world turned about z into the robot's yaw).
"""

from collections.abc import Sequence
from typing import Any

import warp as wp

# Nothing is differentiated, here or in Newton. Modules take this as they are made: before Newton is imported.
wp.config.enable_backward = False

# Loops over matrices of 18 rows are unrolled, which takes half the time of the solver's products and factorisations
# on a CPU, and a quarter more to compile; no bit changes.
wp.config.cpu_compiler_flags = f"{wp.config.cpu_compiler_flags or '-march=native'} -mllvm=-unroll-threshold=10000"

BLOCK_DIM = 64
"""Threads of a block on a GPU: with Warp's 256, kernels of one thread a world leave most of a large GPU idle."""


def launch(kernel: Any, dim: int | Sequence[int], inputs: Sequence[Any]) -> None:
    """Launch a kernel on the default device, in blocks of the size that suits ours."""
    wp.launch(kernel, dim=dim, inputs=inputs, block_dim=BLOCK_DIM)
