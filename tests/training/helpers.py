"""What several tests of training share."""

from pathlib import Path

import torch

from kine2go_warp.learning.checkpoint import load_checkpoint
from kine2go_warp.learning.policy import PolicyFolder


class StopAfter:
    """Says yes when it has been asked so many times: once an iteration."""

    def __init__(self, iterations: int) -> None:
        self.left = iterations

    def __call__(self) -> bool:
        self.left -= 1
        return self.left == 0


def flattened(values, prefix=""):
    """Every tensor and number of a nested checkpoint, by its path."""
    if isinstance(values, dict):
        items = values.items()
    elif isinstance(values, list | tuple):
        items = enumerate(values)
    else:
        return {prefix: values}
    found = {}
    for key, value in items:
        found |= flattened(value, f"{prefix}/{key}")
    return found


def assert_same_training(one: Path, other: Path) -> None:
    """Weights, normalisers, optimiser, worlds, random state: all the same bits, but for the time that it took."""
    ours, theirs = (flattened(load_checkpoint(PolicyFolder(path).latest_checkpoint(), "cpu")) for path in (one, other))
    assert len(ours) > 60
    assert_same_bits(ours, theirs)


def assert_same_bits(ours, theirs):
    """Two flattened checkpoints, or parts of them, hold the same but for the time that it took."""
    ours, theirs = (
        {name: value for name, value in one.items() if not name.endswith("/logger/time")} for one in (ours, theirs)
    )
    assert ours.keys() == theirs.keys()
    differing = []
    for name, value in ours.items():
        if isinstance(value, torch.Tensor):
            same = value.numpy().tobytes() == theirs[name].numpy().tobytes()
        else:
            same = value == theirs[name]
        if not same:
            differing.append(name)
    assert not differing
