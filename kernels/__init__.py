"""Warp kernels and functions: one quantity each, pure, the same code on CPU and CUDA.

Inside kernels quaternions are ``wp.quat`` (x, y, z, w), as in Newton. Frame suffixes: ``_w`` world, ``_b`` base,
``_h`` heading (world turned about z into the robot's yaw).
"""

import warp as wp

# Nothing is differentiated, here or in Newton. Modules take this as they are made: before Newton is imported.
wp.config.enable_backward = False

# Loops over matrices of 18 rows are unrolled, which takes half the time of the solver's products and factorisations
# on a CPU, and a quarter more to compile; no bit changes.
wp.config.cpu_compiler_flags = f"{wp.config.cpu_compiler_flags or '-march=native'} -mllvm=-unroll-threshold=10000"
