"""The .npz export as someone with NumPy alone meets it."""

import json
import zipfile

import numpy as np

from kine2go_warp.dataset.schema import QUALITY_ARRAYS, ROW_ARRAYS, TRAJECTORY_ARRAYS
from kine2go_warp.exports.export import export_dataset
from kine2go_warp.robots import GO2
from tests.exports.conftest import LENGTHS, ORIGINS


def test_every_trajectory_comes_back_bit_for_bit(store, written, tmp_path):
    export_dataset(store, "npz", tmp_path / "out")
    for motion, data in written.items():
        for index, length in enumerate(LENGTHS):
            path = tmp_path / "out" / motion / f"trajectory-{index:04d}.npz"
            with np.load(path, allow_pickle=False) as file:
                for array in ROW_ARRAYS:
                    assert file[array.name].dtype == np.float32
                    np.testing.assert_array_equal(file[array.name], data.rows[array.name][index, :length])
                for array in TRAJECTORY_ARRAYS:
                    assert file[array.name] == data.draws[array.name][index].astype(array.dtype)
                for array in QUALITY_ARRAYS:
                    assert np.isfinite(file[f"quality/{array.name}"])
                np.testing.assert_allclose(file["time"], np.arange(length) / 60.0)
    assert len(list((tmp_path / "out").rglob("*.npz"))) == 6


def test_attributes_are_a_text_of_json_with_units_labels_and_licence(store, tmp_path):
    export_dataset(store, "npz", tmp_path / "out", ["two"])
    with np.load(tmp_path / "out" / "two" / "trajectory-0000.npz", allow_pickle=False) as file:
        assert file["attributes"].dtype.kind == "U"
        attributes = json.loads(str(file["attributes"]))
    assert attributes["motion"]["licence"] == ORIGINS["two"]["licence"]
    assert attributes["dataset"]["control_frequency"] == 60.0
    assert attributes["labels"]["joint"] == list(GO2.joint_names)
    for array in ROW_ARRAYS:
        stored = attributes["arrays"][array.name]
        assert (stored["unit"], stored["description"], tuple(stored["dims"])) == (
            array.unit,
            array.description,
            array.dims,
        )


def test_no_file_holds_a_pickle(store, tmp_path):
    export_dataset(store, "npz", tmp_path / "out")
    with zipfile.ZipFile(tmp_path / "out" / "one" / "trajectory-0000.npz") as archive:
        for name in archive.namelist():
            assert archive.read(name)[:6] == b"\x93NUMPY", name
            assert b"'O'" not in archive.read(name)[:128]
