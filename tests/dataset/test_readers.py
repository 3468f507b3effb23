"""The store opens with other readers and versions, each in an environment of its own (docs/loading.md has the table).

Run as a program it prints that table for a store: ``python -m tests.dataset.test_readers STORE MOTION``.
"""

import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from kine2go_warp.tables import make_table, markdown
from tests.dataset import read_store

ENVIRONMENTS = (
    *(("zarr", f"zarr {version}", (f"zarr=={version}",)) for version in
      ("3.0.0", "3.0.10", "3.1.6", "3.2.1", "3.3.0", "3.4.2")),
    ("xarray", "xarray 2025.1.2 with zarr 3.0.10", ("xarray==2025.1.2", "zarr==3.0.10")),
    ("xarray", "xarray 2026.7.0 with zarr 3.4.2", ("xarray==2026.7.0", "zarr==3.4.2")),
    ("datatree", "the same, `open_datatree`", ("xarray==2026.7.0", "zarr==3.4.2")),
    ("netcdf", "the same, `to_netcdf` and back", ("xarray==2026.7.0", "zarr==3.4.2", "netcdf4==1.7.5.1.post1")),
    ("tensorstore", "tensorstore 0.1.86", ("tensorstore==0.1.86", "numpy")),
)  # fmt: skip
"""Reader, what it is called, and the packages of its environment."""


def newest_python() -> str:
    """The newest Python here, since new versions of zarr want one."""
    found = sorted((Path.home() / ".pyenv" / "versions").glob("3.1[2-9]*/bin/python"))
    return str(found[-1]) if found else sys.executable


def read_in(packages: tuple[str, ...], reader: str, store: Path, motion: str, folder: Path) -> dict:
    """What a reader finds, in a fresh environment in a folder."""
    subprocess.run(["uv", "venv", "-q", "--python", newest_python(), str(folder / "env")], check=True)
    python = str(folder / "env" / "bin" / "python")
    subprocess.run(["uv", "pip", "install", "-q", "--python", python, *packages], check=True, capture_output=True)
    command = [python, str(Path(read_store.__file__)), reader, str(store), motion, str(folder / "motion.nc")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def differences(found: dict, expected: dict) -> dict[str, str]:
    """What of each part is as expected, for the table."""
    numbers = [name for name, values in found["numbers"].items() if values == expected["numbers"][name]]
    return {
        "arrays": f"{len(numbers)} of {len(found['numbers'])}",
        "labels": "yes" if found["labels"] == expected["labels"] else f"no ({found['labels']})",
        "attributes": "yes" if found["attributes"] == expected["attributes"] else "no",
        "records": "yes" if found["records"] == expected["records"] else "no",
    }


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("uv") is None, reason="uv makes the environments")
@pytest.mark.parametrize(("reader", "name", "packages"), ENVIRONMENTS, ids=[one[1] for one in ENVIRONMENTS])
def test_a_reader_in_an_environment_of_its_own_finds_the_same(reader, name, packages, clean_dataset, tmp_path):  # noqa: ARG001
    expected = read_store.found("zarr", str(clean_dataset), "dog_trot")
    found = read_in(packages, reader, clean_dataset, "dog_trot", tmp_path)
    for part in ("attributes", "records"):
        assert found[part] == expected[part], part
    assert found["numbers"] == {name: expected["numbers"][name] for name in found["numbers"]}
    if reader != "tensorstore":
        # It knows no texts; the attribute joint_names says the same.
        assert found["labels"] == expected["labels"] == found["attributes"]["joint_names"]


if __name__ == "__main__":
    whole = read_store.found("zarr", sys.argv[1], sys.argv[2])
    rows = []
    for reader, name, packages in ENVIRONMENTS:
        with tempfile.TemporaryDirectory() as folder:
            try:
                seen = read_in(packages, reader, Path(sys.argv[1]), sys.argv[2], Path(folder))
            except AssertionError as error:
                rows.append((name, f"no: {str(error).splitlines()[-1]}", "", "", ""))
            else:
                rows.append((name, *differences(seen, whole).values()))
    print(markdown(make_table("", ("reader", "arrays equal", "labels", "attributes", "records"), rows)))
