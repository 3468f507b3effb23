"""Reads one motion of a dataset with one reader and prints what it found as JSON: read_store.py READER STORE MOTION.

It imports nothing of this package: it runs in environments that hold the reader alone.
"""

import json
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np

ROWS = ("joint_position", "action", "link_orientation", "reward")
SINGLE = ("length", "seed", "noise", "initial_state/joint_q", "randomization/friction")
ATTRIBUTES = ("conventions", "action_rule", "joint_names", "default_joint_position", "action_scale", "stiffness",
              "damping", "control_frequency", "physics_substeps")  # fmt: skip
RECORDS = ("gather_settings", "simulation")


def with_zarr(store, motion):
    import zarr

    group = zarr.open_group(store, path=motion, mode="r")
    return lambda name: np.asarray(group[name][...]), dict(group.attrs)


def with_xarray(store, motion):
    import xarray

    def read(name):
        folder, _, array = f"{motion}/{name}".rpartition("/")
        return xarray.open_zarr(store, group=folder)[array].values

    return read, xarray.open_zarr(store, group=motion).attrs


def with_datatree(store, motion):
    import xarray

    tree = xarray.open_datatree(store, engine="zarr")
    return lambda name: tree[f"{motion}/{name}"].values, tree[motion].attrs


def with_netcdf(store, motion):
    import xarray

    file = Path(sys.argv[4] if len(sys.argv) > 4 else "motion.nc")
    xarray.open_zarr(store, group=motion).to_netcdf(file)
    data = xarray.open_dataset(file)
    return lambda name: data[name].values, data.attrs


def with_tensorstore(store, motion):
    import tensorstore

    def read(name):
        path = str(Path(store).resolve() / motion / name)
        opened = tensorstore.open({"driver": "zarr3", "kvstore": {"driver": "file", "path": path}}, read=True)
        return opened.result().read().result()

    return read, json.loads((Path(store) / motion / "zarr.json").read_text())["attributes"]


READERS = {
    "zarr": with_zarr,
    "xarray": with_xarray,
    "datatree": with_datatree,
    "netcdf": with_netcdf,
    "tensorstore": with_tensorstore,
}


def attempt(function):
    """What a function returns, or the error's name."""
    try:
        return function()
    except Exception as error:  # noqa: BLE001 - whatever a reader raises is its answer
        return f"{type(error).__name__}"


def total(values):
    """Number and sum of the finite numbers of an array, exact to the last digit of single precision."""
    finite = np.asarray(values, np.float64)[np.isfinite(np.asarray(values, np.float64))]
    return [int(finite.size), float(finite.sum())]


def found(reader, store, motion):
    """Everything that a reader finds in a motion."""
    read, attributes = READERS[reader](store, motion)
    names = {"netcdf": ROWS + tuple(name for name in SINGLE if "/" not in name)}.get(reader, ROWS + SINGLE)
    return {
        "versions": {name: attempt(lambda name=name: version(name)) for name in ("zarr", "xarray", "tensorstore")},
        "numbers": {name: attempt(lambda name=name: total(read(name))) for name in names},
        "labels": attempt(lambda: [str(name) for name in read("joint")]),
        "attributes": {name: np.asarray(attributes[name]).tolist() for name in ATTRIBUTES},
        "records": {name: sorted(json.loads(attributes[name])) for name in RECORDS},
    }


if __name__ == "__main__":
    print(json.dumps(found(*sys.argv[1:4])))
