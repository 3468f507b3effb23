"""The state-action dataset: a Zarr store with one group a motion, readable by anyone with xarray.

What a consumer needs stands here; it imports NumPy and Zarr only. Windows for PyTorch are in ``torch_windows``.
"""

from kine2go_warp.dataset.access import Dataset, Window, open_dataset
from kine2go_warp.dataset.memory import OBSERVATION_ARRAYS, PackedRows, load_rows
from kine2go_warp.dataset.motion import Motion, Trajectory, TrajectoryReference
from kine2go_warp.dataset.statistics import ArrayStatistics, compute_statistics, load_statistics, save_statistics

__all__ = [
    "OBSERVATION_ARRAYS",
    "ArrayStatistics",
    "Dataset",
    "Motion",
    "PackedRows",
    "Trajectory",
    "TrajectoryReference",
    "Window",
    "compute_statistics",
    "load_rows",
    "load_statistics",
    "open_dataset",
    "save_statistics",
]
