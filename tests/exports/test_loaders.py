"""The programs that exports are for read back every number, where they can be installed beside us."""

import pytest

from kine2go_warp.exports.export import FORMATS, export_dataset
from tests.exports.loaders import LOADERS

BESIDE_US = {"minari": "minari", "d4rl": "h5py", "parquet": "datasets"}
"""Targets whose loaders the group of development installs."""


@pytest.mark.parametrize("target", BESIDE_US)
def test_the_loader_of_the_target_reads_every_number(target, store, tmp_path, monkeypatch):
    pytest.importorskip(BESIDE_US[target])
    monkeypatch.setenv("HF_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "out"))
    export_dataset(store, target, tmp_path / "out")
    assert LOADERS[target].check(tmp_path / "out", store) > 110 * 70


def test_every_format_for_learning_has_a_loader():
    assert {loader.form or target for target, loader in LOADERS.items()} >= set(FORMATS) - {"npz"}
