"""The state-action dataset: a Zarr store with one group a motion, readable by anyone with xarray."""
