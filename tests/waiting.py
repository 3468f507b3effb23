"""Finds what a GPU would have to be waited for, on a CPU: values that the host reads, and values that it sends."""

import contextlib

import pytest
import torch
from torch.utils._python_dispatch import TorchDispatchMode

from kine2go_warp.bench.sweep import HostWaits

WAITING = (*HostWaits.READING, "lift_fresh")
"""Operations whose result or shape the host needs, and ``lift_fresh``, by which a tensor is made of numbers."""
READING = ("cpu", "numpy", "item", "tolist", "__bool__", "__float__", "__int__")
"""Methods that read, of which some do nothing at all on a CPU."""


class NoWaits(TorchDispatchMode):
    """Fails at an operation for which the host waits."""

    def __torch_dispatch__(self, function, types, arguments=(), keywords=None):
        assert function.overloadpacket.__name__ not in WAITING, f"{function} waits for the device"
        return function(*arguments, **(keywords or {}))


@contextlib.contextmanager
def no_waits():
    """Fail where the block would wait for a GPU."""

    def forbidden(*_, **__):
        raise AssertionError("the host must not read from the device")

    with pytest.MonkeyPatch.context() as patch, NoWaits():
        for name in READING:
            patch.setattr(torch.Tensor, name, forbidden)
        yield
