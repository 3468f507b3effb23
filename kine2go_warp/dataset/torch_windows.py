"""Random windows for PyTorch, from rows in memory: one by one, or a whole batch at once."""

from collections.abc import Iterator

import numpy as np
import torch
from torch.utils.data import Dataset

from kine2go_warp.dataset.memory import PackedRows
from kine2go_warp.errors import DatasetError

Batch = dict[str, torch.Tensor]


class WindowDataset(Dataset[Batch]):
    """Every window of some trajectories, as a map-style dataset for ``torch.utils.data.DataLoader``.

    An item is a dictionary of tensors by array, each of shape [rows, ...]; they share the memory of the table. It is
    meant for code that wants a DataLoader; :class:`WindowLoader` is faster by far.
    """

    def __init__(self, packed: PackedRows, rows: int, stride: int = 1) -> None:
        """Find the windows.

        Args:
            packed: The rows, from :func:`kine2go_warp.dataset.memory.load_rows`.
            rows: Length of a window.
            stride: Rows from one window to the next in the same trajectory.

        Raises:
            DatasetError: a length or stride is below 1, or no trajectory is that long.
        """
        self.packed, self.rows = packed, rows
        self.starts = packed.window_starts(rows, stride)
        self._table = torch.from_numpy(packed.table)

    def __len__(self) -> int:
        return len(self.starts)

    def __getitem__(self, index: int) -> Batch:
        start = int(self.starts[index])
        return split_columns(self._table[start : start + self.rows], self.packed)


class WindowLoader:
    """Random batches of windows, each cut out of the table by one gather.

    Iterating goes through every window once (an epoch) in an order that depends on the seed and the number of the
    epoch alone. A batch is a dictionary of tensors by array, each of shape [batch_size, rows, ...].
    """

    def __init__(
        self,
        packed: PackedRows,
        rows: int,
        batch_size: int,
        seed: int = 0,
        stride: int = 1,
        shuffle: bool = True,
        drop_last: bool = True,
    ) -> None:
        """Prepare the windows.

        Args:
            packed: The rows, from :func:`kine2go_warp.dataset.memory.load_rows`.
            rows: Length of a window.
            batch_size: Windows in a batch.
            seed: Of the order.
            stride: Rows from one window to the next in the same trajectory.
            shuffle: Whether the order is random.
            drop_last: Whether to leave out the last batch of an epoch where it is smaller than the others.

        Raises:
            DatasetError: a size is below 1, no trajectory is that long, or there are fewer windows than a batch needs.
        """
        self.packed, self.rows, self.batch_size = packed, rows, batch_size
        self.seed, self.shuffle, self.drop_last = seed, shuffle, drop_last
        self.epoch = 0
        """Number of the next epoch; set it to repeat one or to continue."""
        self.starts = packed.window_starts(rows, stride)
        if batch_size < 1:
            raise DatasetError(f"a batch needs at least 1 window, not {batch_size}")
        if len(self) == 0:
            raise DatasetError(f"there are {len(self.starts)} windows, fewer than a batch of {batch_size}")
        table = torch.from_numpy(packed.table)
        num_rows, width = table.shape
        # Window i is the piece of memory from row i on: overlapping rows of a matrix that takes no memory itself.
        self._windows = table.as_strided((num_rows - rows + 1, rows * width), (width, 1))

    def __len__(self) -> int:
        """Batches in an epoch."""
        whole, rest = divmod(len(self.starts), self.batch_size)
        return whole + (rest > 0 and not self.drop_last)

    def __iter__(self) -> Iterator[Batch]:
        order = torch.from_numpy(self._order())
        self.epoch += 1
        for number in range(len(self)):
            yield self.gather(order[number * self.batch_size : (number + 1) * self.batch_size])

    def gather(self, starts: torch.Tensor) -> Batch:
        """Return the windows that begin at given rows of the table.

        Args:
            starts: Rows, some of ``self.starts``, shape [batch_size].
        """
        block = self._windows.index_select(0, starts).view(len(starts), self.rows, -1)
        return split_columns(block, self.packed)

    def _order(self) -> np.ndarray:
        """Return the starts of all windows in the order of this epoch."""
        if not self.shuffle:
            return self.starts
        return np.random.default_rng((self.seed, self.epoch)).permutation(self.starts)


def split_columns(block: torch.Tensor, packed: PackedRows) -> Batch:
    """Return views of rows of the table by array.

    Args:
        block: Rows, shape [..., num_columns].
        packed: Where the arrays lie.
    """
    lead = block.shape[:-1]
    return {
        name: block[..., place.start : place.stop].view(*lead, *place.shape) if place.shape else block[..., place.start]
        for name, place in packed.columns.items()
    }
