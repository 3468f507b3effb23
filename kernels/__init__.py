"""Warp kernels and functions: one quantity each, pure, the same code on CPU and CUDA.

Inside kernels quaternions are ``wp.quat`` (x, y, z, w), as in Newton. Frame suffixes: ``_w`` world, ``_b`` base,
``_h`` heading (world turned about z into the robot's yaw).
"""

import warp as wp

# Nothing is differentiated, here or in Newton. Modules take this as they are made: before Newton is imported.
wp.config.enable_backward = False
