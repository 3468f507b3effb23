"""Checkpoints: written whole, read without running any code in them, and checked bit by bit."""

import hashlib
import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from kine2go_warp.errors import PolicyError
from kine2go_warp.files import atomic_file

OTHER_RANKS = "other_ranks"
"""Key of what the processes but the first go on from, where torchrun has trained with several."""


def write_checkpoint(path: Path, values: dict[str, Any]) -> None:
    """Write a checkpoint whole or not at all."""
    buffer = io.BytesIO()
    torch.save(values, buffer)
    # Through memory, since torch reports a full disk as an internal error.
    with atomic_file(path) as temporary:
        temporary.write_bytes(buffer.getbuffer())


def load_checkpoint(path: Path, device: str) -> dict[str, Any]:
    """Read a checkpoint without running any code in it.

    Raises:
        PolicyError: it is damaged or of another kind.
    """
    try:
        # Torch does not compare the checksums that it writes.
        with zipfile.ZipFile(path) as archive:
            damaged = archive.testzip()
        checkpoint = torch.load(path, map_location=device, weights_only=True) if damaged is None else None
    except Exception as error:  # noqa: BLE001 - damaged files raise errors of many kinds
        raise PolicyError(f"{path}: not a checkpoint that can be read ({error.__class__.__name__})") from None
    if damaged is not None:
        raise PolicyError(f"{path}: not a checkpoint that can be read ({damaged} is damaged)")
    if not isinstance(checkpoint, dict) or "actor_state_dict" not in checkpoint:
        raise PolicyError(f"{path}: not a checkpoint of 'kine2go policy train'")
    return checkpoint


def acting_weights(checkpoint: dict[str, Any]) -> dict[str, torch.Tensor]:
    """Return the weights of the best policy so far; where none was evaluated, those of the last iteration."""
    return checkpoint.get("policy_state_dict", checkpoint["actor_state_dict"])


def weights_hash(checkpoint: Path) -> str:
    """Return the SHA-256 of the actor that acts, its normaliser included: of all that decides how the policy acts.

    It is not that of the file, which also holds what only training needs.
    """
    digest = hashlib.sha256()
    for name, values in sorted(acting_weights(load_checkpoint(checkpoint, "cpu")).items()):
        digest.update(f"{name} {values.dtype} {tuple(values.shape)}".encode())
        digest.update(values.contiguous().numpy().tobytes())
    return digest.hexdigest()


def tensors(arrays: dict[str, NDArray[Any]]) -> dict[str, torch.Tensor]:
    """Return arrays as tensors, which a checkpoint may hold."""
    return {name: torch.from_numpy(np.ascontiguousarray(array)) for name, array in arrays.items()}


def arrays(values: dict[str, torch.Tensor]) -> dict[str, NDArray[Any]]:
    """Return tensors of a checkpoint as arrays."""
    return {name: tensor.cpu().numpy() for name, tensor in values.items()}
