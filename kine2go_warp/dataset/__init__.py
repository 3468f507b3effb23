"""The state-action dataset: a Zarr store with one group a motion, readable by anyone with xarray."""

from kine2go_warp.dataset.access import Dataset, Window, open_dataset
from kine2go_warp.dataset.motion import Motion, Trajectory, TrajectoryReference

__all__ = ["Dataset", "Motion", "Trajectory", "TrajectoryReference", "Window", "open_dataset"]
