"""Kernels are tested on every device that is there."""

from collections.abc import Iterator

import pytest
import warp as wp

DEVICES = ["cpu", *(pytest.param(device.alias, marks=pytest.mark.gpu) for device in wp.get_cuda_devices())]


@pytest.fixture(autouse=True, params=DEVICES)
def device(request: pytest.FixtureRequest) -> Iterator[None]:
    """Make one of them the default, which arrays and launches without a device of their own take."""
    with wp.ScopedDevice(request.param):
        yield
