"""What a control step asks of Warp, kernel by kernel, seen from outside."""

import contextlib
from dataclasses import dataclass, field

import numpy as np
import pytest
import warp as wp

from kine2go_warp.env.environment import ImitationEnvironment


@dataclass
class Seen:
    """What was launched and allocated; within the solver's loop, and outside of it."""

    kernels: set[tuple[wp.Module, int]] = field(default_factory=set)
    """Modules, each with the threads of a block that a kernel of it is launched with."""
    launches: int = 0
    allocations: int = 0
    loops: int = 0
    loop_launches: int = 0
    loop_allocations: int = 0


@contextlib.contextmanager
def watched():
    """Count within the block. Eager execution is needed: a captured graph is one launch."""
    seen, within = Seen(), [False]
    launch, launch_tiled, capture_while, make = wp.launch, wp.launch_tiled, wp.capture_while, wp.array.__init__

    def count_launch(function):
        def counted(kernel, *arguments, **options):
            if not np.prod(options["dim"] if "dim" in options else arguments[0]):
                return None
            seen.kernels.add((kernel.module, options.get("block_dim", kernel.module.options["block_dim"])))
            seen.loop_launches += within[0]
            seen.launches += not within[0]
            return function(kernel, *arguments, **options)

        return counted

    def count_array(self, data=None, *arguments, **options):
        assert data is None, "nothing is read from the host"
        make(self, data, *arguments, **options)
        if options.get("ptr") is None and self.size:
            seen.loop_allocations += within[0]
            seen.allocations += not within[0]

    def loop(condition, while_body=None, **options):
        def body(**rest):
            within[0] = True
            seen.loops += 1
            while_body(**rest)
            within[0] = False

        capture_while(condition, while_body=body, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(wp, "launch", count_launch(launch))
        patch.setattr(wp, "launch_tiled", count_launch(launch_tiled))
        patch.setattr(wp, "capture_while", loop)
        patch.setattr(wp.array, "__init__", count_array)
        yield seen


def eager(clips, config):
    """An environment whose kernels are launched one by one, after a step that loads them."""
    environment = ImitationEnvironment(clips, config, "cpu", use_graph=False)
    environment.step()
    return environment
