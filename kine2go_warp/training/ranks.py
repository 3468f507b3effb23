"""Several processes that train one policy, each on its own GPU with its share of the worlds, started by torchrun."""

import contextlib
import io
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

from kine2go_warp.device import choose_device
from kine2go_warp.errors import Kine2GoError, PolicyError
from kine2go_warp.interruption import TrainingInterrupted

if TYPE_CHECKING:
    from kine2go_warp.env.config import EnvConfig

Decision = TypeVar("Decision")


@dataclass(frozen=True)
class Ranks:
    """Which of the processes of a training this one is.

    The first one reads and writes the policy folder, evaluates and decides; what it decides, all do. Methods that
    exchange something must be called by all processes, in the same order.
    """

    rank: int = 0
    """Number of this process among all."""
    size: int = 1
    """How many there are."""
    local_rank: int = 0
    """Number of this process, and of its GPU, among those of this machine."""

    @classmethod
    def of_torchrun(cls) -> "Ranks":
        """Return what torchrun says of this process; a single one if torchrun has not started it."""
        rank, size, local_rank = (int(os.environ.get(name) or 0) for name in ("RANK", "WORLD_SIZE", "LOCAL_RANK"))
        return cls(rank, size, local_rank) if size > 1 else ALONE

    @property
    def is_first(self) -> bool:
        """Whether this is the process that decides and writes."""
        return self.rank == 0

    def device(self, name: str | None) -> str:
        """Return the device of this process: that of the name, or the GPU that has the number of the process.

        Raises:
            Kine2GoError: there is no such device.
            PolicyError: one GPU is named for several processes.
        """
        if self.size > 1 and name not in (None, "cuda", "cpu"):
            raise PolicyError(f"--device {name} names one device for {self.size} processes; leave it out")
        device = choose_device(name)
        return device if self.size == 1 or device == "cpu" else choose_device(f"cuda:{self.local_rank}")

    def share(self, config: "EnvConfig") -> "EnvConfig":
        """Return the settings of this process' worlds.

        Raises:
            PolicyError: they cannot be shared equally; RSL-RL takes the plain mean of the processes' gradients.
        """
        if config.num_worlds % self.size:
            raise PolicyError(f"{config.num_worlds} worlds cannot be shared equally by {self.size} processes")
        return replace(config, num_worlds=config.num_worlds // self.size)

    @contextlib.contextmanager
    def connected(self, device: str) -> Iterator[None]:
        """Let the processes exchange tensors on their devices, and Python's objects.

        Args:
            device: That of this process.

        Raises:
            PolicyError: the others cannot be found.
        """
        if self.size == 1:
            yield
            return
        import torch

        if device != "cpu":
            torch.cuda.set_device(device)
        backend = "gloo" if device == "cpu" else "cpu:gloo,cuda:nccl"
        try:
            torch.distributed.init_process_group(backend, rank=self.rank, world_size=self.size)
        except ValueError as error:
            raise PolicyError(
                f"WORLD_SIZE is {self.size}, but torchrun has not started this process ({error}); unset it"
            ) from None
        try:
            yield
        finally:
            torch.distributed.destroy_process_group()

    def first_decides(self, decide: Callable[[], Decision]) -> Decision:
        """Return in all processes what a function returns, or raise what it raises; only the first one calls it."""
        if self.size == 1:
            return decide()
        import torch

        outcome: list[Any] = [None, None]
        if self.is_first:
            try:
                outcome[0] = decide()
            except (Kine2GoError, TrainingInterrupted) as error:
                outcome[1] = error
        packet = [packed(outcome) if self.is_first else b""]
        torch.distributed.broadcast_object_list(packet, src=0)
        decision, error = unpacked(packet[0])
        if error is not None:
            raise error
        return decision

    def gathered(self, value: Any) -> list[Any]:
        """Return the values of all processes to the first one, and nothing to the others."""
        if self.size == 1:
            return [value]
        import torch

        packets = [b""] * self.size
        torch.distributed.gather_object(packed(value), packets if self.is_first else None, dst=0)
        return [unpacked(packet) for packet in packets] if self.is_first else []


ALONE = Ranks()
"""A training in one process."""


def packed(value: Any) -> bytes:
    """Return an object as bytes. Torch's own exchange of objects does not know tensors of unsigned integers."""
    import torch

    buffer = io.BytesIO()
    torch.save(value, buffer)
    return buffer.getvalue()


def unpacked(packet: bytes) -> Any:
    """Return the object that ``packed`` has taken.

    It holds records and errors, not only tensors. It comes from a process of the same training and from no file;
    torch's own exchange of objects unpickles in the same way.
    """
    import torch

    return torch.load(io.BytesIO(packet), weights_only=False)


def check_alone(what: str) -> None:
    """Check that torchrun has not started this process beside others, which would do the same work at the same place.

    Args:
        what: The work.

    Raises:
        Kine2GoError: it has.
    """
    size = Ranks.of_torchrun().size
    if size > 1:
        raise Kine2GoError(
            f"WORLD_SIZE is {size}, as torchrun sets it, and {what} is the work of one process; only 'kine2go policy "
            "train' is shared by several"
        )
