import pytest
import torch


@pytest.fixture(scope="session", autouse=True)
def one_thread():
    """As on the command line; sums of several threads have other bits, and busy cores make them slow."""
    torch.set_num_threads(1)
