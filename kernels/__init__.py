"""Warp kernels and functions: one quantity each, pure, the same code on CPU and CUDA.

Inside kernels quaternions are ``wp.quat`` (x, y, z, w), as in Newton. Frame suffixes: ``_w`` world, ``_b`` base,
``_h`` heading (world turned about z into the robot's yaw).
"""

import warp as wp

# Nothing here is differentiated; leaving the adjoint code out halves the compile time.
wp.set_module_options({"enable_backward": False})
